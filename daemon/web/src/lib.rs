//! Parts that the trainer's pages share: one look, vendored browser libraries, and pages that need no other file.

#![forbid(unsafe_code)]

use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// The palettes of ships' bridges, and the style sheet that all pages share.
pub const LOOK: &str = concat!(include_str!("../assets/palettes.css"), include_str!("../assets/look.css"));

/// A module of JavaScript.
#[derive(Clone, Copy, Debug)]
pub struct Module {
    /// Its name. Others import it by that, or as a file beside them.
    pub name: &'static str,
    /// Its source.
    pub source: &'static str,
}

/// Three-dimensional drawing by three.js, with its core and the camera that is moved about a point.
pub const THREE: [Module; 3] = [
    Module { name: "three.core.js", source: include_str!("../assets/vendor/three/three.core.js") },
    Module { name: "three", source: include_str!("../assets/vendor/three/three.module.js") },
    Module { name: "three/OrbitControls", source: include_str!("../assets/vendor/three/OrbitControls.js") },
];

/// A chart's plane about the gun: scale, rings, bearing, boats with names.
pub const PLANE: Module = Module { name: "bowwave/plane", source: include_str!("../assets/plane.js") };

/// Plots over time by uPlot.
pub const UPLOT: Module =
    Module { name: "uplot", source: include_str!("../assets/vendor/uplot/uPlot.esm.js") };

/// Style sheet of [`UPLOT`].
pub const UPLOT_STYLE: &str = include_str!("../assets/vendor/uplot/uPlot.min.css");

/// A page in one file, which needs no network and no other file.
#[derive(Debug)]
pub struct Page<'a> {
    /// Its title.
    pub title: &'a str,
    /// Style besides [`LOOK`].
    pub style: &'a str,
    /// Content of its body.
    pub body: Markup,
    /// Data as JSON, which scripts find in the element `data`.
    pub data: &'a str,
    /// All modules.
    pub modules: &'a [Module],
    /// The name of the one that is run.
    pub main: &'a str,
    /// It plays a video from a file near it.
    pub plays_files: bool,
}

impl Page<'_> {
    /// The page as HTML. Scripts are let run by their place in it alone: nothing is loaded from elsewhere.
    pub fn to_html(&self) -> String {
        // Nothing that the page's data says is run, and nothing is fetched.
        const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' data:; style-src 'unsafe-inline'; img-src data: blob:; \
                              base-uri 'none'; form-action 'none'; media-src data: blob:";
        // A page from the disk has no origin of its own: its neighbours are files.
        let policy = if self.plays_files { format!("{POLICY} 'self' file:") } else { POLICY.to_owned() };
        let page = html! {
            (DOCTYPE)
            html lang="en" data-obc-theme="day" {
                head {
                    meta charset="utf-8";
                    meta http-equiv="Content-Security-Policy" content=(policy);
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (self.title) }
                    style { (PreEscaped(LOOK)) (PreEscaped(self.style)) }
                    script type="importmap" { (PreEscaped(import_map(self.modules))) }
                }
                body {
                    (self.body)
                    script type="application/json" id="data" { (PreEscaped(self.data.replace('<', "\\u003c"))) }
                    script type="module" { (PreEscaped(format!("import \"{}\";", self.main))) }
                }
            }
        };
        page.into_string()
    }
}

/// The import map: each module as a data URL.
fn import_map(modules: &[Module]) -> String {
    let entries: Vec<String> = modules
        .iter()
        .map(|module| {
            let url = format!("data:text/javascript;base64,{}", STANDARD.encode(inlined(module, modules)));
            format!("\"{}\":\"{url}\"", module.name)
        })
        .collect();
    format!("{{\"imports\":{{{}}}}}", entries.join(","))
}

/// A module's source with paths to others turned into names: a data URL has nothing beside it.
fn inlined(module: &Module, modules: &[Module]) -> String {
    modules.iter().fold(module.source.to_owned(), |source, other| {
        let (path, name) = (format!("./{}", other.name), other.name);
        source
            .replace(&format!("'{path}'"), &format!("'{name}'"))
            .replace(&format!("\"{path}\""), &format!("\"{name}\""))
    })
}

#[cfg(test)]
mod tests {
    use sha2::{Digest as _, Sha256};

    use super::*;

    /// SHA-256 of vendored files, as `assets/vendor/SOURCES.md` has them.
    #[test]
    fn vendored_files_are_those_of_their_packages() {
        let sources = include_str!("../assets/vendor/SOURCES.md");
        let files = [
            ("three/three.core.js", THREE[0].source),
            ("three/three.module.js", THREE[1].source),
            ("three/OrbitControls.js", THREE[2].source),
            ("uplot/uPlot.esm.js", UPLOT.source),
            ("uplot/uPlot.min.css", UPLOT_STYLE),
            ("uplot/uPlot.d.ts", include_str!("../assets/vendor/uplot/uPlot.d.ts")),
        ];
        for (name, text) in files {
            let hash: String = Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect();
            let row = sources.lines().find(|line| line.contains(&format!("`{name}`"))).unwrap_or_default();
            assert!(row.contains(&hash), "{name} is {hash}, and its row says {row:?}");
        }
    }

    #[test]
    fn data_cannot_end_its_element_and_modules_find_each_other() {
        let modules = [
            Module { name: "a.js", source: "import { b } from \"./b.js\";" },
            Module { name: "b.js", source: "export const b = 1;" },
        ];
        let data = r#"{"boat":"</script><script>alert(1)</script><!--"}"#;
        let page = Page {
            title: "<t>",
            style: "",
            body: html! { p { "</body>" } },
            data,
            modules: &modules,
            main: "a.js",
            plays_files: false,
        };
        let html = page.to_html();
        assert!(!html.contains("alert(1)</script>") && html.contains("\\u003c/script>"), "{html}");
        assert!(html.contains("<title>&lt;t&gt;</title>"));
        let coded = STANDARD.encode("import { b } from \"b.js\";");
        assert!(html.contains(&coded), "its path is a name now");
        assert_eq!(html.matches("<script").count(), 3);
    }
}
