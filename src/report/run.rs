//! A whole run as JSON.

use super::build::{VERSION, commit};
use super::classes::{ClassRow, class_table};
use super::table::{Align, Table, grouped};
use serde::{Deserialize, Deserializer, Serialize};

/// What `--report` writes. Times make it the one output that differs between equal runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RunReport {
    /// Program that ran: `semvs densify`, `DensifyPointCloud`, ...
    pub program: String,
    /// Its version.
    pub version: String,
    /// The commit that it is built from, twelve digits; `None` = not known.
    pub commit: Option<String>,
    /// Instruction set of the estimator's kernels; `None` = nothing is estimated.
    pub cpu_level: Option<String>,
    /// The scene as given on the command line.
    pub scene: String,
    /// Every option in effect under its command-line name.
    pub options: serde_json::Map<String, serde_json::Value>,
    /// Time by stage, in order of execution.
    pub stages: Vec<StageTime>,
    /// Wall time of the whole run, seconds.
    pub seconds: f64,
    /// Time of all threads together, seconds; `None` = not measured.
    pub cpu_seconds: Option<f64>,
    /// Largest resident size of the process so far, bytes; `None` = not known.
    pub peak_memory_bytes: Option<u64>,
    /// Views of the scene in order.
    pub views: Vec<ViewReport>,
    /// Points of the dense cloud.
    pub points: u64,
    /// Semantic classes by id; empty without labels.
    pub classes: Vec<ClassRow>,
    /// Files written.
    pub outputs: Vec<OutputReport>,
    /// Everything that was warned of, one line each.
    pub warnings: Vec<String>,
}

/// Time spent in one stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StageTime {
    /// Name of the stage.
    pub stage: String,
    /// Wall time, seconds.
    pub seconds: f64,
    /// Time of all threads together, seconds; `None` = not measured.
    pub cpu_seconds: Option<f64>,
    /// Largest resident size of the process at its end, bytes; `None` = not known.
    pub peak_memory_bytes: Option<u64>,
}

/// One view of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ViewReport {
    /// Position in the scene.
    pub index: u32,
    /// Global ID, which names the depth map.
    pub id: u32,
    /// Image path as the scene names it.
    pub image: String,
    /// Size of the depth map in pixels, 0 where there is none.
    pub width: u32,
    /// See `width`.
    pub height: u32,
    /// Global IDs of the source views, best first.
    pub sources: Vec<u32>,
    /// Depths allowed, scene units.
    #[serde(deserialize_with = "range")]
    pub depth_range: [f32; 2],
    /// Pixels with a depth in the final map.
    pub valid_depths: u64,
    /// `valid_depths` over all pixels, 0..1.
    pub coverage: f64,
    /// Mean confidence of the valid depths; `None` = not stored.
    pub mean_confidence: Option<f64>,
    /// Whether an existing depth map was used as it was.
    pub reused: bool,
    /// The label map that was read; `None` = no labels or all void.
    pub labels: Option<String>,
    /// Why the view took no part; `None` = it did.
    pub dropped: Option<String>,
}

/// Two depths; JSON has no infinity but `null`.
fn range<'de, D: Deserializer<'de>>(from: D) -> Result<[f32; 2], D::Error> {
    Ok(<[Option<f32>; 2]>::deserialize(from)?.map(|depth| depth.unwrap_or(f32::INFINITY)))
}

/// A file that the run wrote.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct OutputReport {
    /// Path as given or derived.
    pub path: String,
    /// What it holds: `dense cloud`, `dense cloud of class window`, `scene`, `depth map`, ...
    pub content: String,
    /// Points in it; `None` for files without points.
    pub points: Option<u64>,
}

impl RunReport {
    /// Says that `program` of this build ran.
    pub fn of_this_build(&mut self, program: &str) {
        program.clone_into(&mut self.program);
        VERSION.clone_into(&mut self.version);
        self.commit = commit().map(str::to_owned);
    }

    /// Indented JSON with a final newline; keys in the order of the fields above.
    ///
    /// # Errors
    /// None in practice: every value has a JSON form (an infinity becomes `null`).
    pub fn to_json(&self) -> serde_json::Result<String> {
        let mut text = serde_json::to_string_pretty(self)?;
        text.push('\n');
        Ok(text)
    }

    /// The summary for people: classes if there are labels, files, times.
    pub fn summary(&self) -> String {
        let mut text = String::new();
        if !self.classes.is_empty() {
            text.push_str(&class_table(&self.classes));
            text.push('\n');
        }
        let mut outputs =
            Table::new(&[("output", Align::Left), ("content", Align::Left), ("points", Align::Right)]);
        for output in &self.outputs {
            let points = output.points.map(grouped).unwrap_or_default();
            outputs.row([output.path.clone(), output.content.clone(), points]);
        }
        text.push_str(&outputs.to_string());
        let stages = self.stages.iter().map(|stage| format!("{} {:.1} s", stage.stage, stage.seconds));
        let stages = stages.collect::<Vec<_>>().join(", ");
        let detail = if stages.is_empty() { stages } else { format!(" ({stages})") };
        text.push_str(&format!("\n{} points in {:.1} s{detail}\n", grouped(self.points), self.seconds));
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> RunReport {
        RunReport {
            program: "semvs densify".into(),
            version: "0.1.0".into(),
            commit: Some("2078195a0b1c".into()),
            cpu_level: Some("avx2".into()),
            scene: "scene.mvs".into(),
            options: [("number-views-fuse".to_owned(), serde_json::json!(2))].into_iter().collect(),
            stages: vec![StageTime { stage: "fusion".into(), seconds: 1.25, ..StageTime::default() }],
            seconds: 12.0,
            cpu_seconds: Some(20.0),
            peak_memory_bytes: None,
            views: vec![ViewReport { id: 12, depth_range: [1.0, f32::INFINITY], ..ViewReport::default() }],
            points: 12_345,
            classes: vec![ClassRow {
                id: 1,
                name: "wall".into(),
                kept: true,
                pixels: 3,
                ..ClassRow::default()
            }],
            outputs: vec![OutputReport {
                path: "x.ply".into(),
                content: "dense cloud".into(),
                points: Some(12_345),
            }],
            warnings: Vec::new(),
        }
    }

    #[test]
    fn json_holds_everything_under_the_field_names() {
        let text = report().to_json().unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(json["options"]["number-views-fuse"], 2);
        assert_eq!(json["stages"][0]["seconds"], 1.25);
        assert_eq!(json["cpu_level"], "avx2");
        assert_eq!(json["classes"][0]["name"], "wall");
        assert_eq!(json["classes"][0]["mean_confidence"], serde_json::Value::Null);
        assert_eq!(json["views"][0]["id"], 12);
        assert_eq!(json["views"][0]["depth_range"][1], serde_json::Value::Null);
        assert_eq!(json["outputs"][0]["points"], 12_345);
        assert!(text.ends_with("}\n"));
    }

    #[test]
    fn a_report_is_read_as_it_was_written() {
        let read: RunReport = serde_json::from_str(&report().to_json().unwrap()).unwrap();
        assert_eq!(read, report());
        let older: RunReport =
            serde_json::from_str(r#"{"program": "semvs", "more": 1, "stages": []}"#).unwrap();
        assert_eq!(older, RunReport { program: "semvs".into(), ..RunReport::default() });
    }

    #[test]
    fn the_summary_ends_with_points_and_times() {
        let text = report().summary();
        assert!(text.starts_with("class  id"), "{text}");
        assert!(text.contains("x.ply   dense cloud  12 345\n"), "{text}");
        assert!(text.ends_with("\n12 345 points in 12.0 s (fusion 1.2 s)\n"), "{text}");
        let unlabelled = RunReport { classes: Vec::new(), ..report() };
        assert!(unlabelled.summary().starts_with("output"));
    }
}
