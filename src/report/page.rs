//! A run as one HTML page that needs nothing else: no network, no other file.

use super::classes::ClassRow;
use super::document::Document;
use super::pictures::Ramp;
use super::run::{OutputReport, StageTime};
use serde::Serialize;
use serde_json::{Map, Value};

const BODY: &str = include_str!("page/run.html");
const SCRIPT: &str = include_str!("page/run.js");

/// Bars of the histograms of a page.
pub const BARS: usize = 20;

/// What a page shows; the scripts in `page/` read it as JSON. Lengths are scene units.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ReportPage {
    /// The headline.
    pub title: String,
    /// Program that ran; empty = unknown.
    pub program: String,
    /// Its version and commit.
    pub version: String,
    /// Instruction set of the estimator's kernels.
    pub cpu_level: Option<String>,
    /// The scene.
    pub scene: String,
    /// Wall time of the run, seconds; 0 = unknown.
    pub seconds: f64,
    /// Time of all its threads, seconds.
    pub cpu_seconds: Option<f64>,
    /// Most memory it took, bytes.
    pub peak_memory: Option<u64>,
    /// Points of the whole cloud.
    pub points: u64,
    /// Options by their long names.
    pub options: Map<String, Value>,
    /// Times by stage.
    pub stages: Vec<StageTime>,
    /// Classes that occur, by id; of runs that left no summary with their points alone.
    pub classes: Vec<ClassRow>,
    /// What was warned of.
    pub warnings: Vec<String>,
    /// Files written.
    pub outputs: Vec<OutputReport>,
    /// All views, in the scene's order.
    pub views: Vec<PageView>,
    /// Global ids of two views and how well they match.
    pub edges: Vec<(u32, u32, f32)>,
    /// Views by the share of their pixels that have a depth.
    pub coverage_histogram: [u64; BARS],
    /// Depths by confidence.
    pub confidence_histogram: [u64; BARS],
    /// What the colours of pictures mean.
    pub ramps: PageRamps,
    /// The cloud, if there is one to show.
    pub cloud: Option<PageCloud>,
}

/// A view.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PageView {
    /// Position in the scene.
    pub index: u32,
    /// Global id.
    pub id: u32,
    /// Image as the scene names it.
    pub image: String,
    /// Columns of its depth map, 0 where there is none.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Global ids of the source views, best first.
    pub sources: Vec<u32>,
    /// Share of the pixels that have a depth.
    pub coverage: f64,
    /// Mean confidence of those.
    pub mean_confidence: Option<f64>,
    /// Why it took no part.
    pub dropped: Option<String>,
    /// Share of its depths whose class is not kept, or is not what other views see there by majority; `None` = not compared.
    pub removed: Option<f64>,
    /// Its camera, if it has a pose.
    pub camera: Option<PageCamera>,
    /// Depths of the two ends of the ramp.
    pub depth_scale: [f32; 2],
    /// Its pictures.
    pub layers: PageLayers,
}

/// A camera in the frame of the viewer's points: the world, moved so that the least corner of their box is the origin.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PageCamera {
    /// Centre.
    pub center: [f64; 3],
    /// Direction of view, unit length.
    pub axis: [f64; 3],
    /// Direction of the image's columns, unit length.
    pub down: [f64; 3],
    /// Directions of the image's corners, upper left first, clockwise; one unit along the axis.
    pub corners: [[f64; 3]; 4],
}

/// The pictures of a view as `data:` addresses.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PageLayers {
    /// Photograph.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// Depths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth: Option<String>,
    /// Normals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal: Option<String>,
    /// Confidences.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confidence: Option<String>,
    /// Label map.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub labels: Option<String>,
    /// Depths that have their class against them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub removed: Option<String>,
}

/// Colours from the first to the last end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PageRamps {
    /// Of depths.
    pub depth: &'static [[u8; 3]],
    /// Of confidences.
    pub confidence: &'static [[u8; 3]],
}

impl Default for PageRamps {
    fn default() -> Self {
        PageRamps { depth: Ramp::DEPTH.stops(), confidence: Ramp::CONFIDENCE.stops() }
    }
}

/// The cloud of the viewer. Coordinates are relative to the least corner of its box, and so are those of cameras.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PageCloud {
    /// Points that are shown.
    pub count: usize,
    /// Size of the box about them.
    pub extent: [f64; 3],
    /// Median of their coordinates.
    pub center: [f64; 3],
    /// Length across most of the points.
    pub span: f64,
    /// Distance between neighbouring points.
    pub spacing: f64,
    /// Views that see the best seen points, at most 127.
    pub most_views: u32,
    /// Whether they have colours.
    pub has_colors: bool,
    /// Whether their confidence is known.
    pub has_confidence: bool,
    /// Whether the number of views that see them is known.
    pub has_views: bool,
    /// Whether they have normals.
    pub has_normals: bool,
    /// Whether their labels have confidences.
    pub has_label_confidence: bool,
    /// What the class of a point means, by position.
    pub classes: Vec<PageCloudClass>,
}

/// A class of the viewer's points.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PageCloudClass {
    /// Name.
    pub name: String,
    /// Red, green, blue.
    pub color: [u8; 3],
    /// Points of it that are shown.
    pub points: u64,
    /// Whether they are shown at first.
    pub shown: bool,
}

/// Adds `value`, of 0 to 1, to a histogram.
pub fn add_to(bars: &mut [u64; BARS], value: f64) {
    bars[((value.max(0.0) * BARS as f64) as usize).min(BARS - 1)] += 1;
}

impl ReportPage {
    /// The page. `points`: those of [`PageCloud`], as [`super::packed`] has them.
    ///
    /// # Errors
    /// None in practice: every value has a JSON form.
    pub fn render(&self, points: &[u8]) -> serde_json::Result<String> {
        Document { title: &self.title, body: BODY, script: SCRIPT }.render(self, points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;

    #[test]
    fn names_cannot_break_out_of_the_page() {
        let page = ReportPage {
            title: "a</title><b>".to_owned(),
            scene: "</script><script>alert(1)</script>{{POINTS}}".to_owned(),
            ..ReportPage::default()
        };
        let text = page.render(b"points").unwrap();
        assert!(text.contains("<title>a&lt;/title&gt;&lt;b&gt;</title>"), "{text}");
        assert!(!text.contains("alert(1)</script>"));
        assert!(text.contains("{{POINTS}}"), "what is filled in is no template");
        assert_eq!(text.matches(&STANDARD.encode(b"points")).count(), 1);
        let data = text.split_once("id=\"data\">").unwrap().1.split_once("</script>").unwrap().0;
        let data: Value = serde_json::from_str(data).unwrap();
        assert_eq!(data["scene"], page.scene);
        assert!(data["cloud"].is_null() && data["ramps"]["depth"][0][0] == 253);
    }

    #[test]
    fn the_page_asks_nobody_for_anything() {
        let text = ReportPage::default().render(&[]).unwrap();
        for word in ["http:", "https:", "//cdn", "@import", "fetch(", "XMLHttpRequest", "src=\""] {
            let found =
                text.match_indices(word).filter(|(at, _)| !text[*at..].starts_with("http://www.w3.org/"));
            assert_eq!(found.count(), 0, "{word}");
        }
        assert!(text.contains("default-src 'none'"));
        assert!(!text.contains("{{"), "all places are filled");
    }

    #[test]
    fn histograms_hold_every_value() {
        let mut bars = [0; BARS];
        [-1.0, 0.0, 0.049, 0.05, 0.999, 1.0, 3.0].iter().for_each(|&v| add_to(&mut bars, v));
        assert_eq!((bars[0], bars[1], bars[19], bars.iter().sum::<u64>()), (3, 1, 3, 7));
    }
}
