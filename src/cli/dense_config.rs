//! The file behind `--dense-config-file`: internal parameters, one `Title = value` per line.

use crate::error::{Error, Result};
use std::path::Path;

/// Parameters that have no option of their own. Names and defaults are OpenMVS's.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DenseConfig {
    pub(crate) min_views: u32,
    pub(crate) max_views: u32,
    pub(crate) min_views_filter: u32,
    pub(crate) min_views_filter_adjust: u32,
    pub(crate) min_views_trust_point: u32,
    pub(crate) point_inside_roi: u32,
    pub(crate) filter_adjust: u32,
    pub(crate) view_min_score: f32,
    pub(crate) view_min_score_ratio: f32,
    pub(crate) min_area: f32,
    pub(crate) min_angle_deg: f32,
    pub(crate) optim_angle_deg: f32,
    pub(crate) max_angle_deg: f32,
    pub(crate) depth_diff_threshold: f32,
    pub(crate) normal_diff_threshold_deg: f32,
    pub(crate) pairwise_mul: f32,
    pub(crate) optimizer_eps: f32,
    pub(crate) optimizer_max_iters: u32,
    pub(crate) speckle_size: u32,
    pub(crate) interpolate_gap_size: u32,
    pub(crate) ncc_threshold_keep: f32,
    pub(crate) geometric_weight: f32,
    /// "Optimize", the bits of `--postprocess-dmaps`, if the file has it.
    pub(crate) optimize: Option<u32>,
}

impl Default for DenseConfig {
    fn default() -> Self {
        DenseConfig {
            min_views: 2,
            max_views: 12,
            min_views_filter: 2,
            min_views_filter_adjust: 1,
            min_views_trust_point: 2,
            point_inside_roi: 1,
            filter_adjust: 1,
            view_min_score: 2.0,
            view_min_score_ratio: 0.03,
            min_area: 0.05,
            min_angle_deg: 3.0,
            optim_angle_deg: 12.0,
            max_angle_deg: 65.0,
            depth_diff_threshold: 0.01,
            normal_diff_threshold_deg: 25.0,
            pairwise_mul: 0.3,
            optimizer_eps: 0.001,
            optimizer_max_iters: 80,
            speckle_size: 100,
            interpolate_gap_size: 7,
            ncc_threshold_keep: 0.9,
            geometric_weight: 0.1,
            optimize: None,
        }
    }
}

/// What a title in the file stands for.
enum Entry {
    Count(fn(&mut DenseConfig) -> &mut u32),
    Number(fn(&mut DenseConfig) -> &mut f32),
    Optimize,
    /// The command line decides, as in OpenMVS: this option, also by its default.
    CommandLine(&'static str),
    /// A parameter of an algorithm that is not used here.
    WithoutEffect,
}

/// Title, OpenMVS's default, meaning; in the order in which a new file lists them.
const TABLE: &[(&str, &str, Entry)] = &[
    ("Resolution Level", "1", Entry::CommandLine("resolution-level")),
    ("Max Resolution", "3200", Entry::CommandLine("max-resolution")),
    ("Min Resolution", "640", Entry::CommandLine("min-resolution")),
    ("SubResolution levels", "2", Entry::CommandLine("sub-resolution-levels")),
    ("Min Views", "2", Entry::Count(|c| &mut c.min_views)),
    ("Max Views", "12", Entry::Count(|c| &mut c.max_views)),
    ("Min Views Fuse", "2", Entry::CommandLine("number-views-fuse")),
    ("Min Views Filter", "2", Entry::Count(|c| &mut c.min_views_filter)),
    ("Min Views Filter Adjust", "1", Entry::Count(|c| &mut c.min_views_filter_adjust)),
    ("Min Views Trust Point", "2", Entry::Count(|c| &mut c.min_views_trust_point)),
    ("Num Views", "0", Entry::CommandLine("number-views")),
    ("Point Inside ROI", "1", Entry::Count(|c| &mut c.point_inside_roi)),
    ("Filter Adjust", "1", Entry::Count(|c| &mut c.filter_adjust)),
    ("Add Corners", "0", Entry::WithoutEffect),
    ("Init Sparse", "1", Entry::WithoutEffect),
    ("Remove Dmaps", "0", Entry::CommandLine("remove-dmaps")),
    ("View Min Score", "2.0", Entry::Number(|c| &mut c.view_min_score)),
    ("View Min Score Ratio", "0.03", Entry::Number(|c| &mut c.view_min_score_ratio)),
    ("Min Area", "0.05", Entry::Number(|c| &mut c.min_area)),
    ("Min Angle", "3.0", Entry::Number(|c| &mut c.min_angle_deg)),
    ("Optim Angle", "12.0", Entry::Number(|c| &mut c.optim_angle_deg)),
    ("Max Angle", "65.0", Entry::Number(|c| &mut c.max_angle_deg)),
    ("Descriptor Min Magnitude Threshold", "0.02", Entry::WithoutEffect),
    ("Depth Diff Threshold", "0.01", Entry::Number(|c| &mut c.depth_diff_threshold)),
    ("Normal Diff Threshold", "25", Entry::Number(|c| &mut c.normal_diff_threshold_deg)),
    ("Pairwise Mul", "0.3", Entry::Number(|c| &mut c.pairwise_mul)),
    ("Optimizer Eps", "0.001", Entry::Number(|c| &mut c.optimizer_eps)),
    ("Optimizer Max Iters", "80", Entry::Count(|c| &mut c.optimizer_max_iters)),
    ("Speckle Size", "100", Entry::Count(|c| &mut c.speckle_size)),
    ("Interpolate Gap Size", "7", Entry::Count(|c| &mut c.interpolate_gap_size)),
    ("Ignore Mask Label", "-1", Entry::CommandLine("ignore-mask-label")),
    ("Optimize", "7", Entry::Optimize),
    ("Estimate Colors", "2", Entry::CommandLine("estimate-colors")),
    ("Estimate Normals", "0", Entry::CommandLine("estimate-normals")),
    ("NCC Threshold Keep", "0.9", Entry::Number(|c| &mut c.ncc_threshold_keep)),
    ("Estimation Iters", "3", Entry::CommandLine("iters")),
    ("Estimation Geometric Iters", "2", Entry::CommandLine("geometric-iters")),
    ("Estimation Geometric Weight", "0.1", Entry::Number(|c| &mut c.geometric_weight)),
    ("Random Iters", "6", Entry::WithoutEffect),
    ("Random Max Scale", "2", Entry::WithoutEffect),
    ("Random Depth Ratio", "0.003", Entry::WithoutEffect),
    ("Random Angle1 Range", "16.0", Entry::WithoutEffect),
    ("Random Angle2 Range", "10.0", Entry::WithoutEffect),
    ("Random Smooth Depth", "0.02", Entry::WithoutEffect),
    ("Random Smooth Normal", "13", Entry::WithoutEffect),
    ("Random Smooth Bonus", "0.93", Entry::WithoutEffect),
];

/// The parameters in the file at `path` and remarks about entries that change nothing. When the file does not
/// exist it is created with the defaults.
///
/// # Errors
/// An unreadable file, a line that is no assignment, a value that is no number; the file cannot be created.
pub(crate) fn load(path: &Path) -> Result<(DenseConfig, Vec<String>)> {
    match std::fs::read(path) {
        Ok(bytes) => parse(&String::from_utf8_lossy(&bytes)).map_err(|what| Error::content(path, what)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            std::fs::write(path, default_text()).map_err(|e| Error::io(path, "create", e))?;
            Ok((DenseConfig::default(), Vec::new()))
        }
        Err(error) => Err(Error::io(path, "read", error)),
    }
}

/// The whole table with its defaults.
fn default_text() -> String {
    TABLE.iter().map(|(title, default, _)| format!("{title} = {default}\n")).collect()
}

fn parse(text: &str) -> std::result::Result<(DenseConfig, Vec<String>), String> {
    let mut config = DenseConfig::default();
    let mut remarks = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let number = i + 1;
        let line = line.split('#').next().unwrap_or_default().trim().trim_start_matches('\u{feff}');
        if line.is_empty() {
            continue;
        }
        let Some((title, value)) = line.split_once('=') else {
            const MOST: usize = 40;
            let more = if line.chars().count() > MOST { "..." } else { "" };
            let line: String = line.chars().take(MOST).collect();
            return Err(format!("line {number}: '{line}{more}' is not of the form 'Title = value'"));
        };
        let (title, value) = (title.trim(), value.trim());
        let bad = |expected: &str| format!("line {number}: '{title}' is '{value}', expected {expected}");
        let Some((_, default, entry)) = TABLE.iter().find(|(t, _, _)| *t == title) else {
            remarks.push(format!("line {number}: '{title}' is not known and is ignored"));
            continue;
        };
        match entry {
            Entry::Count(field) => {
                *field(&mut config) = value.parse().map_err(|_| bad("a whole number >= 0"))?
            }
            Entry::Number(field) => *field(&mut config) = finite(value).ok_or_else(|| bad("a number"))?,
            Entry::Optimize => config.optimize = Some(value.parse().map_err(|_| bad("a sum of 1, 2, 4"))?),
            Entry::CommandLine(option) if !same(value, default) => {
                remarks.push(format!("line {number}: '{title}' is decided by --{option} alone"));
            }
            Entry::WithoutEffect if !same(value, default) => {
                remarks.push(format!("line {number}: '{title}' has no effect on the estimator used here"));
            }
            Entry::CommandLine(_) | Entry::WithoutEffect => {}
        }
    }
    Ok((config, remarks))
}

fn finite(text: &str) -> Option<f32> {
    text.parse().ok().filter(|v: &f32| v.is_finite())
}

fn same(value: &str, default: &str) -> bool {
    value == default || finite(value).is_some_and(|v| finite(default) == Some(v))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_file_changes_nothing_and_needs_no_remark() {
        let (config, remarks) = parse(&default_text()).unwrap();
        assert_eq!(config, DenseConfig { optimize: Some(7), ..DenseConfig::default() });
        assert_eq!(remarks, Vec::<String>::new());
    }

    #[test]
    fn titles_with_spaces_are_read() {
        let (config, remarks) = parse("Optimize = 7\nMin Views Filter = 1\r\n").unwrap();
        assert_eq!((config.optimize, config.min_views_filter), (Some(7), 1));
        assert!(remarks.is_empty());
    }

    #[test]
    fn entries_without_effect_are_named() {
        let (_, remarks) = parse("Max Resolution = 100\n# x\nRandom Iters = 9\nNope = 1").unwrap();
        assert_eq!(
            remarks,
            [
                "line 1: 'Max Resolution' is decided by --max-resolution alone",
                "line 3: 'Random Iters' has no effect on the estimator used here",
                "line 4: 'Nope' is not known and is ignored",
            ]
        );
    }

    #[test]
    fn mistakes_name_line_and_title() {
        assert_eq!(
            parse("Min Views = x").unwrap_err(),
            "line 1: 'Min Views' is 'x', expected a whole number >= 0"
        );
        assert!(parse("View Min Score = nan").is_err());
        assert!(parse("Min Views").is_err());
    }

    #[test]
    fn a_missing_file_is_created_with_the_defaults() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("Densify.ini");
        assert_eq!(load(&path).unwrap().0, DenseConfig::default());
        assert!(std::fs::read_to_string(&path).unwrap().contains("Max Resolution = 3200\n"));
        let (again, remarks) = load(&path).unwrap();
        assert_eq!((again.optimize, remarks.len()), (Some(7), 0));
    }
}
