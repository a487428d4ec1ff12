//! An HTML file that needs nothing else: the frame of all pages, their style and scripts, and their data.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

const FRAME: &str = include_str!("page/frame.html");
const STYLE: &str = include_str!("page/page.css");
const VIEWER: &str = include_str!("page/viewer.js");
const PARTS: &str = include_str!("page/parts.js");

/// What tells pages apart.
pub(super) struct Document<'a> {
    /// Title of the window.
    pub(super) title: &'a str,
    /// The sections, as HTML.
    pub(super) body: &'static str,
    /// What fills them.
    pub(super) script: &'static str,
}

impl Document<'_> {
    /// The page. `data` is what the script reads; `points`: those of the 3D view, as [`super::packed`] has them.
    pub(super) fn render(&self, data: &impl Serialize, points: &[u8]) -> serde_json::Result<String> {
        // Nothing in a string may end the script element that holds it.
        let data = serde_json::to_string(data)?.replace('<', "\\u003c");
        let points = STANDARD.encode(points);
        let title = escaped(self.title);
        Ok(filled(FRAME, |name| match name {
            "TITLE" => &title,
            "STYLE" => STYLE,
            "BODY" => self.body,
            "DATA" => &data,
            "POINTS" => &points,
            "VIEWER" => VIEWER,
            "PARTS" => PARTS,
            "SCRIPT" => self.script,
            _ => "",
        }))
    }
}

/// `bytes` as a `data:` address.
pub fn data_address(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", STANDARD.encode(bytes))
}

/// `template` with every `{{NAME}}` replaced; what is filled in is left as it is.
fn filled<'a>(template: &str, value: impl Fn(&str) -> &'a str) -> String {
    let mut out = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        let Some((name, behind)) = after.split_once("}}") else { break };
        out.push_str(before);
        out.push_str(value(name));
        rest = behind;
    }
    out + rest
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
