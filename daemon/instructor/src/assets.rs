//! Parts of the page, compiled in.

use std::borrow::Cow;

/// A part of the page.
pub(crate) struct Asset {
    pub(crate) kind: &'static str,
    pub(crate) text: Cow<'static, str>,
}

const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

/// The page's own modules.
const MODULES: [(&str, &str); 8] = [
    ("main.js", include_str!("../assets/main.js")),
    ("connection.js", include_str!("../assets/connection.js")),
    ("picture.js", include_str!("../assets/picture.js")),
    ("chart.js", include_str!("../assets/chart.js")),
    ("commands.js", include_str!("../assets/commands.js")),
    ("panels.js", include_str!("../assets/panels.js")),
    ("scenarios.js", include_str!("../assets/scenarios.js")),
    ("dom.js", include_str!("../assets/dom.js")),
];

/// The part of that name.
pub(crate) fn find(name: &str) -> Option<Asset> {
    match name {
        "look.css" => Some(Asset { kind: STYLE, text: Cow::Borrowed(bowwave_web::LOOK) }),
        "instructor.css" => {
            Some(Asset { kind: STYLE, text: Cow::Borrowed(include_str!("../assets/instructor.css")) })
        }
        "plane.js" => Some(Asset { kind: SCRIPT, text: Cow::Borrowed(bowwave_web::PLANE.source) }),
        _ => {
            let (_, source) = MODULES.into_iter().find(|(known, _)| *known == name)?;
            // Modules of the other crate have names, files beside this one have paths.
            let text = source.replace(&format!("\"{}\"", bowwave_web::PLANE.name), "\"./plane.js\"");
            Some(Asset { kind: SCRIPT, text: Cow::Owned(text) })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_import_only_what_is_served() {
        for (name, _) in MODULES {
            let text = find(name).unwrap().text;
            for line in text.lines().filter(|line| line.starts_with("import ")) {
                let path = line.split('"').nth(1).unwrap();
                let file = path.strip_prefix("./").unwrap_or_else(|| panic!("{name} imports {path}"));
                assert!(find(file).is_some(), "{name} imports {path}");
            }
        }
        for name in ["", ".", "../Cargo.toml", "main.js/", "Main.js"] {
            assert!(find(name).is_none(), "{name}");
        }
    }
}
