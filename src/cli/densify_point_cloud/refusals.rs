//! Options of OpenMVS that this program does not have: said in one line, before any work.

use super::args::DropInArgs;

/// Refuses what was asked for and is not available. Default values ask for nothing.
///
/// # Errors
/// One line that names the option and, where there is one, the way around.
pub(crate) fn check(args: &DropInArgs) -> Result<(), String> {
    let actions = &args.actions;
    let refusals = [
        (
            !(-1..=3).contains(&args.archive_type) && !args.strict_openmvs,
            "--archive-type",
            "give -1 (interface), 0 (text), 1 (binary), 2 (zlib) or 3 (zstd)",
        ),
        (
            !matches!(args.shared.estimation.fusion_mode, 0 | 1),
            "--fusion-mode",
            "disparity maps are not available; use 0 (everything) or 1 (depth maps only)",
        ),
        (actions.sample_mesh != 0.0, "--sample-mesh", "meshes are not read"),
        (actions.mesh_file.is_some(), "--mesh-file", "meshes are not read"),
        (
            actions.export_depth_maps_name.is_some(),
            "--export-depth-maps-name",
            "it renders depth maps of a mesh, and meshes are not read",
        ),
    ];
    match refusals.iter().find(|(asked, _, _)| *asked) {
        Some((_, option, why)) => Err(format!("{option} is refused: {why}")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    fn checked(words: &[&str]) -> Result<(), String> {
        check(&DropInArgs::try_parse_from(words).unwrap())
    }

    #[test]
    fn refusals_name_the_option() {
        for word in [
            "--archive-type=4",
            "--archive-type=-2",
            "--fusion-mode=-1",
            "--fusion-mode=-2",
            "--sample-mesh=-5",
            "--mesh-file=m.ply",
            "--export-depth-maps-name=x",
        ] {
            let option = word.split('=').next().unwrap();
            let error = checked(&[word]).unwrap_err();
            assert!(error.starts_with(&format!("{option} is refused: ")), "{error}");
        }
    }

    #[test]
    fn defaults_and_harmless_values_pass() {
        assert_eq!(checked(&[]), Ok(()));
        let harmless =
            ["--cuda-device=-2", "--process-priority=0", "--tower-mode=4", "--filter-point-cloud=20"];
        assert_eq!(checked(&harmless), Ok(()));
        assert_eq!(checked(&["--archive-type=3", "--sub-scene-area=0", "--fusion-mode=1"]), Ok(()));
    }
}
