//! The page that shows the pictures: one file that needs no other and no network.

use base64::{Engine, engine::general_purpose::STANDARD};
use maud::{DOCTYPE, PreEscaped, html};

use super::design::Design;

/// Style of the page.
const STYLE: &str = include_str!("page.css");
/// The session with a participant: one picture after the other, two keys, answers saved as CSV.
const SCRIPT: &str = include_str!("page.js");

/// The page of a design of that name; `files` are the pictures as PNG, in the design's order.
pub fn page(study: &str, design: &Design, files: &[Vec<u8>]) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                title { "Real or not?" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                img #picture alt="";
                div #text {}
                script { (PreEscaped(data(study, design, files))) (PreEscaped(SCRIPT)) }
            }
        }
    };
    page.into_string()
}

/// The pictures and the participants' orders, as a JavaScript constant.
fn data(study: &str, design: &Design, files: &[Vec<u8>]) -> String {
    let pictures: Vec<[String; 2]> = (0..)
        .zip(files)
        .map(|(index, file)| [design.name(index), format!("data:image/png;base64,{}", STANDARD.encode(file))])
        .collect();
    // Names are p001 and so on, the rest is base64, hexadecimal digits and numbers: nothing in it can end the script.
    format!(
        "const STUDY = {};\n",
        serde_json::json!({ "study": study, "pictures": pictures, "orders": design.orders })
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_holds_all_and_asks_the_network_for_nothing() {
        let design = Design::new(1, 2, 5);
        let files: Vec<Vec<u8>> = (0..design.items.len()).map(|i| vec![i as u8; 9]).collect();
        let page = page("5ea51de5", &design, &files);
        assert_eq!(page.matches("data:image/png;base64,").count(), design.items.len());
        assert!(!page.contains("http"));
        assert!(
            page.starts_with("<!DOCTYPE html><html lang=\"en\">")
                && page.ends_with("</script></body></html>")
        );
        assert!(page.contains("state === \"shown\" && (key"), "the script stands in it unescaped");
        let json = page.split("const STUDY = ").nth(1).and_then(|s| s.split(";\n").next()).expect("the data");
        let data: serde_json::Value = serde_json::from_str(json).expect("JSON");
        assert_eq!(data["orders"][1].as_array().map(Vec::len), Some(design.items.len()));
        assert_eq!(data["pictures"][3][0], "p004");
        // Nothing in it tells which pictures are real.
        assert!(!page.contains("full_as_published") && !page.contains("textured"));
    }
}
