//! What the programs print and write as JSON is what the schemas in `docs/reference/schemas` say.

use crate::common::{FUSE_ONLY, SEMVS, SMALL, Scratch, facade6, fixtures};
use serde_json::{Map, Value};
use std::collections::BTreeSet;
use std::path::Path;

const LABELS: &str = "--label-path labels --class-table 3dom-facade";

/// A schema, and the names of the properties that outputs have had.
struct Schema {
    name: &'static str,
    value: Value,
    seen: BTreeSet<String>,
}

impl Schema {
    fn read(name: &'static str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("docs/reference/schemas/{name}.json"));
        let value: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        Schema { name, value, seen: BTreeSet::new() }
    }

    /// Asserts that `text` is as the schema says, and has no property that the schema does not know.
    #[track_caller]
    fn accept(&mut self, text: &str) {
        let output: Value = serde_json::from_str(text).unwrap();
        let mut strict = self.value.clone();
        close(&mut strict);
        let validator = jsonschema::validator_for(&strict).unwrap();
        let problems: Vec<String> =
            validator.iter_errors(&output).map(|e| format!("{}: {e}", e.instance_path())).collect();
        assert!(problems.is_empty(), "{}: {problems:?}\n{text}", self.name);
        names(&output, &mut self.seen);
    }

    /// Asserts that every property of the schema was in some output, so that none is described that is never written.
    #[track_caller]
    fn all_seen(&self) {
        let mut described = BTreeSet::new();
        properties(&self.value, &mut described);
        let never: Vec<&String> = described.difference(&self.seen).collect();
        assert!(never.is_empty(), "{}: no output here has {never:?}", self.name);
    }
}

/// Lets the objects of a schema have no properties but those that it lists.
fn close(schema: &mut Value) {
    match schema {
        Value::Object(map) => {
            if map.get("properties").is_some_and(Value::is_object) && map.contains_key("required") {
                map.insert("additionalProperties".to_owned(), Value::Bool(false));
            }
            map.values_mut().for_each(close);
        }
        Value::Array(items) => items.iter_mut().for_each(close),
        _ => {}
    }
}

fn names(output: &Value, seen: &mut BTreeSet<String>) {
    match output {
        Value::Object(map) => map.iter().for_each(|(name, value)| {
            seen.insert(name.clone());
            names(value, seen);
        }),
        Value::Array(items) => items.iter().for_each(|item| names(item, seen)),
        _ => {}
    }
}

fn properties(schema: &Value, described: &mut BTreeSet<String>) {
    match schema {
        Value::Object(map) => {
            if let Some(listed) = map.get("properties").and_then(Value::as_object)
                && map.contains_key("required")
            {
                described.extend(listed.keys().cloned());
            }
            map.values().for_each(|value| properties(value, described));
        }
        Value::Array(items) => items.iter().for_each(|item| properties(item, described)),
        _ => {}
    }
}

#[test]
fn reports_of_runs() {
    let mut schema = Schema::read("run-report");
    let scratch = Scratch::facade6();
    // A view that takes no part, and estimation.
    std::fs::remove_file(scratch.path("images/0013.jpg")).unwrap();
    let words =
        format!("densify scene.mvs {SMALL} --iters 1 --geometric-iters 0 --report a.json -o a.ply -w out");
    scratch.semvs(&format!("{words} {LABELS} --split-by-class --exclude-classes sky")).ok();
    schema.accept(&String::from_utf8(scratch.read("a.json")).unwrap());
    scratch.semvs("fuse scene.mvs --depth-maps out --report b.json -o b.laz").ok();
    schema.accept(&String::from_utf8(scratch.read("b.json")).unwrap());
    scratch.add_maps("post7", ".");
    scratch.densify_point_cloud(&format!("-i scene.mvs -o c.mvs {} --report c.json", FUSE_ONLY)).ok();
    schema.accept(&String::from_utf8(scratch.read("c.json")).unwrap());
    schema.all_seen();
}

#[test]
fn inspections_of_every_kind_of_file() {
    let mut schema = Schema::read("inspect");
    let scratch = Scratch::with_maps();
    scratch.semvs(&format!("fuse scene.mvs -o cloud.ply {LABELS} --ply-layout openmvs")).ok();
    scratch.semvs("convert cloud.ply -o cloud.laz --class-table 3dom-facade").ok();
    scratch.write(
        "table.toml",
        "[[class]]\nid = 1\nname = \"wall\"\ncolor = [1, 2, 3]\nlas = 6\n[[class]]\nid = 2\nname = \"sky\"\nkeep = false\n",
    );
    scratch.semvs("labels render scene.mvs --cloud cloud.ply -o ids --ids").ok();
    for file in [
        "scene.mvs",
        "depth0000.dmap",
        "cloud.ply",
        "cloud.laz",
        "images/0003.jpg",
        "labels/0003_l.png",
        "ids/0003.png",
        "table.toml",
    ] {
        schema.accept(&scratch.semvs(&format!("inspect {file} --json")).ok().stdout);
    }
    // Files in every variant, with masks, regions of interest, project archives, and faults.
    let mut inspected = 0;
    for folder in ["mvsi", "native", "ply", "other"] {
        for entry in std::fs::read_dir(fixtures().join("format-corpus").join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let outcome = scratch.run(SEMVS, &["inspect", path.to_str().unwrap(), "--json"]);
            if outcome.code == Some(0) {
                schema.accept(&outcome.stdout);
                inspected += 1;
            }
        }
    }
    assert!(inspected > 25, "{inspected}");
    // A region of interest, and elements besides the points.
    let boxed = "0 1 0 -1 0 0 0 0 1 1 2 3 4 5 6";
    scratch.write("roi.txt", boxed);
    scratch.densify_point_cloud("-i scene.mvs -o boxed.mvs --import-roi-file roi.txt").ok();
    schema.accept(&scratch.semvs("inspect boxed.mvs --json").ok().stdout);
    let faces = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                 element face 0\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n";
    scratch.write("faces.ply", faces);
    schema.accept(&scratch.semvs("inspect faces.ply --json").ok().stdout);
    schema.all_seen();
}

#[test]
fn evaluations() {
    let mut schema = Schema::read("evaluate");
    let scratch = Scratch::with_maps();
    std::fs::copy(facade6().join("truth/truth.ply"), scratch.path("truth.ply")).unwrap();
    scratch.semvs(&format!("fuse scene.mvs -o cloud.ply {LABELS}")).ok();
    let words = "evaluate cloud.ply --truth truth.ply --thresholds 0.05 0.1 --json";
    schema.accept(&scratch.semvs(words).ok().stdout);
    schema.accept(&scratch.semvs(&format!("{words} --per-class")).ok().stdout);
    schema.all_seen();
}

#[test]
fn comparisons() {
    let mut schema = Schema::read("compare");
    let scratch = Scratch::with_maps();
    scratch.add_maps("post3", "post3");
    scratch.write(
        "limits.toml",
        "[limits]\nmaps.both = { min = 7 }\nvalid.iou = { min = 0.99 }\ndepth.p50 = { max = 1.0 }\n",
    );
    let outside = scratch.semvs("compare post3 . --json --expect limits.toml");
    assert_eq!(outside.code, Some(1), "{}", outside.stderr);
    schema.accept(&outside.stdout);
    schema.accept(&scratch.semvs("compare scene.mvs scene.mvs --json").ok().stdout);
    scratch.semvs("convert depth0000.dmap -o a.ply").ok();
    scratch.semvs("convert depth0001.dmap -o b.ply").ok();
    schema.accept(&scratch.semvs("compare a.ply b.ply --json").ok().stdout);
    schema.all_seen();
}

#[test]
fn checks_of_label_maps() {
    let mut schema = Schema::read("labels-check");
    let scratch = Scratch::with_maps();
    schema.accept(&scratch.semvs(&format!("labels check scene.mvs {LABELS} --json")).ok().stdout);
    std::fs::remove_file(scratch.path("labels/0003_l.png")).unwrap();
    let faulty = scratch.semvs(&format!("labels check scene.mvs {LABELS} --json"));
    assert_eq!(faulty.code, Some(1), "{}", faulty.stderr);
    schema.accept(&faulty.stdout);
    schema.all_seen();
}

/// The test of outputs can fail: a property too many, one of another type, one that is missing.
#[test]
fn what_is_not_as_a_schema_says_is_refused() {
    let mut strict = Schema::read("labels-check").value;
    close(&mut strict);
    let validator = jsonschema::validator_for(&strict).unwrap();
    let sound =
        serde_json::json!({"table": "t", "classes": [], "compared_by": "nothing", "views": [], "faults": 0});
    assert!(validator.is_valid(&sound));
    let changed = |change: &dyn Fn(&mut Map<String, Value>)| {
        let mut value = sound.clone();
        change(value.as_object_mut().unwrap());
        value
    };
    assert!(!validator.is_valid(&changed(&|map| drop(map.insert("more".to_owned(), Value::from(1))))));
    assert!(!validator.is_valid(&changed(&|map| drop(map.insert("faults".to_owned(), Value::from("none"))))));
    assert!(!validator.is_valid(&changed(&|map| drop(map.remove("views")))));
}
