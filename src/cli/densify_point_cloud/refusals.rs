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
            !(-1..=3).contains(&args.archive_type),
            "--archive-type",
            "give -1 (interface), 0 (text), 1 (binary), 2 (zlib) or 3 (zstd)",
        ),
        (
            !matches!(args.shared.estimation.fusion_mode, 0 | 1),
            "--fusion-mode",
            "disparity maps are not available; use 0 (everything) or 1 (depth maps only)",
        ),
        (actions.estimate_scale > 0.0, "--estimate-scale", "exporting points with scale is not available"),
        (actions.sub_scene_area > 0.0, "--sub-scene-area", "splitting a scene is not available"),
        (actions.sample_mesh != 0.0, "--sample-mesh", "meshes are not read"),
        (
            actions.filter_point_cloud < 0,
            "--filter-point-cloud",
            "filtering a finished cloud by visibility is not available",
        ),
        (
            actions.export_number_views != 0,
            "--export-number-views",
            "exporting points by their number of views is not available",
        ),
        (actions.mesh_file.is_some(), "--mesh-file", "meshes are not read"),
        (
            actions.export_depth_maps_name.is_some(),
            "--export-depth-maps-name",
            "exporting depth maps as images is not available",
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
            "--estimate-scale=1",
            "--sub-scene-area=660000",
            "--sample-mesh=-5",
            "--filter-point-cloud=-20",
            "--export-number-views=3",
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
