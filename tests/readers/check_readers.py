#!/usr/bin/env python3
"""Opens every kind of cloud that semvs writes with pymeshlab, Open3D and laspy and checks counts and properties.

    cargo build --release
    python3 -m venv venv && venv/bin/pip install numpy pymeshlab open3d laspy lazrs
    venv/bin/python tests/readers/check_readers.py [--semvs target/release/semvs] [FILE.ply FILE.las ...]

Readers that are not installed are skipped with a line. Files that are given are checked besides those that are made.
Exit code: 0 all opened, 1 something did not, 2 nothing could be checked.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "compat-fixtures/facade6"
LAYOUTS = ["plain", "openmvs", "odm"]


def optional(name):
    """A module, or None with a line that says why."""
    try:
        return __import__(name)
    except Exception as error:  # a missing system library is no ImportError everywhere
        print(f"skipped: {name} cannot be used here ({str(error).splitlines()[0]})")
        return None


def header(path):
    """Number of vertices and their properties, by the file's own header."""
    count, properties, element = 0, {}, None
    with open(path, "rb") as file:
        for line in file:
            words = line.decode("utf-8", "replace").split()
            if words[:1] == ["element"]:
                element = words[1]
                count = int(words[2]) if element == "vertex" else count
            elif words[:1] == ["property"] and element == "vertex":
                properties[words[-1]] = words[1]
            elif words == ["end_header"]:
                return count, properties
    raise ValueError("no end_header")


def expect(what, found, wanted):
    if found != wanted:
        raise ValueError(f"{what}: {found}, the header says {wanted}")


def with_pymeshlab(module, path):
    count, properties = header(path)
    meshes = module.MeshSet(verbose=False)
    meshes.load_new_mesh(str(path))
    mesh = meshes.current_mesh()
    expect("points", mesh.vertex_number(), count)
    expect("colours", mesh.has_vertex_color(), "red" in properties)
    if "nx" in properties:
        lengths = (mesh.vertex_normal_matrix() ** 2).sum(axis=1)
        expect("normals of length 1", bool((abs(lengths - 1.0) < 1e-3).all()), True)
    return f"{count} points"


def with_open3d(module, path):
    count, properties = header(path)
    cloud = module.io.read_point_cloud(str(path))
    expect("points", len(cloud.points), count)
    expect("colours", cloud.has_colors(), "red" in properties)
    expect("normals", cloud.has_normals(), "nx" in properties)
    table = module.t.io.read_point_cloud(str(path))
    expect("points (tensor)", len(table.point.positions), count)
    seen = [name for name in ("label", "label_confidence", "views") if name in table.point]
    wanted = [name for name in ("label", "label_confidence", "views") if name in properties]
    expect("other properties", seen, wanted)
    if "label" in seen:
        expect("labels", table.point["label"].shape[0], count)
    return f"{count} points, {', '.join(['position'] + seen)}"


def with_laspy(module, path):
    with module.open(str(path)) as file:
        cloud = file.read()
        expect("points", len(cloud.points), file.header.point_count)
        names = list(cloud.point_format.dimension_names)
        twin = path.with_suffix(".ply")
        if twin.is_file():
            farthest = farthest_from_twin(cloud, twin)
            expect("within half a millimetre of the PLY", farthest <= 0.0005, True)
        return f"{len(cloud.points)} points, {', '.join(names)}"


def farthest_from_twin(cloud, twin):
    """Largest difference of a coordinate from those of the PLY file without lists that holds the same points."""
    import numpy

    count, properties = header(twin)
    sizes = {"float": "<f4", "float32": "<f4", "uchar": "u1", "uint8": "u1", "double": "<f8", "ushort": "<u2"}
    kinds = numpy.dtype([(name, sizes[kind]) for name, kind in properties.items()])
    data = twin.read_bytes()
    start = data.index(b"end_header\n") + len(b"end_header\n")
    points = numpy.frombuffer(data, kinds, count, start)
    return max(abs(cloud[axis] - points[axis].astype(float)).max() for axis in ("x", "y", "z"))


def run(semvs, *words):
    done = subprocess.run([str(semvs), *map(str, words)], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{semvs} {' '.join(map(str, words))}: exit code {done.returncode}\n{done.stderr[-2000:]}")


def make_clouds(semvs, folder):
    """Every layout, with and without labels, and the clouds by class and in class colours."""
    labels = ["--label-path", SCENE / "labels", "--class-table", "3dom-facade"]
    scene = SCENE / "scene.mvs"
    run(semvs, "densify", scene, "-o", folder / "made.ply", "-w", folder / "maps", *labels)
    for layout in LAYOUTS:
        for name, words in (("", []), ("-labels", labels)):
            out = folder / f"{layout}{name}.ply"
            run(semvs, "fuse", scene, "--depth-maps", folder / "maps", "-o", out, "--ply-layout", layout, *words)
    for extension in ("ply", "las", "laz"):
        out = folder / f"classes.{extension}"
        forms = ["--split-by-class", "--color-by-label"]
        run(semvs, "fuse", scene, "--depth-maps", folder / "maps", "-o", out, *labels, *forms)
    return sorted(path for path in folder.glob("*.*") if path.suffix in (".ply", ".las", ".laz"))


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--semvs", type=Path, default=ROOT / "target/release/semvs")
    arguments.add_argument("files", nargs="*", type=Path)
    given = arguments.parse_args()
    readers = [
        (name, read, module)
        for name, read, package in (
            ("pymeshlab", with_pymeshlab, "pymeshlab"),
            ("Open3D", with_open3d, "open3d"),
            ("laspy", with_laspy, "laspy"),
        )
        if (module := optional(package)) is not None
    ]
    failed = checked = 0
    with tempfile.TemporaryDirectory() as scratch:
        clouds = list(given.files)
        if given.semvs.is_file():
            clouds += make_clouds(given.semvs, Path(scratch))
        else:
            print(f"skipped: {given.semvs} is not there; build it or name it with --semvs")
        for path in clouds:
            is_las = path.suffix in (".las", ".laz")
            for name, read, module in readers:
                if is_las != (name == "laspy"):
                    continue
                checked += 1
                try:
                    print(f"ok: {name} opens {path.name}: {read(module, path)}")
                except Exception as error:
                    failed += 1
                    print(f"FAILED: {name} on {path.name}: {error}")
    print(f"{checked} checks, {failed} failed")
    return 2 if checked == 0 else int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
