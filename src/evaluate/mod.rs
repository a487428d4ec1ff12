//! How good is a result: clouds and depth maps against ground truth, and against each other.

mod cloud;
mod compare;
mod labels;
mod maps;
mod reliability;

pub use cloud::{
    ClassScore, ClassScores, CloudScoreOptions, CloudScores, DistanceScore, LabelledPoints, cloud_scores,
};
pub use compare::{
    Agreement, CLOUD_FIGURES, Catalog, Check, CloudComparison, ComparedImage, ComparedScene, Comparison,
    Differences, FOLDER_FIGURES, Figure, Figures, FirstDifference, Kind, Limit, MAP_FIGURES, MapComparison,
    MapDifferences, Part, Presence, SCENE_FIGURES, Shape, Sizes, Tolerance, check_limits, compare_clouds,
    compare_maps, compare_scenes, folder_figures, map_differences, names,
};
pub use labels::LabelScores;
pub use maps::{MapScoreOptions, MapScores, map_scores};
pub use reliability::ReliabilityBin;

/// `value` to so many decimals.
fn round_to<const DECIMALS: i32>(value: f64) -> f64 {
    let scale = 10f64.powi(DECIMALS);
    (value * scale).round() / scale
}

/// Serializes a number to so many decimals.
fn rounded<const DECIMALS: i32, S: serde::Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64(round_to::<DECIMALS>(*value))
}

/// Serializes a number, if there is one, to so many decimals.
fn rounded_option<const DECIMALS: i32, S: serde::Serializer>(
    value: &Option<f64>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serde::Serialize::serialize(&value.map(round_to::<DECIMALS>), serializer)
}
