//! The page that shows the pictures: one file that needs no other and no network.

use base64::{Engine, engine::general_purpose::STANDARD};

use super::design::Design;

/// The page without its pictures.
const TEMPLATE: &str = include_str!("page.html");
/// What the pictures take the place of.
const PLACE: &str = "/*STUDY*/";

/// The page of a design; `files` are the pictures as PNG, in the design's order.
pub fn page(design: &Design, files: &[Vec<u8>]) -> String {
    let mut data = String::from("const STUDY = {\"pictures\": [");
    for (index, file) in files.iter().enumerate() {
        let comma = if index == 0 { "" } else { "," };
        let png = STANDARD.encode(file);
        data += &format!("{comma}\n[\"{}\",\"data:image/png;base64,{png}\"]", design.name(index));
    }
    data += "],\n\"orders\": [";
    for (index, order) in design.orders.iter().enumerate() {
        let comma = if index == 0 { "" } else { "," };
        let numbers: Vec<String> = order.iter().map(usize::to_string).collect();
        data += &format!("{comma}\n[{}]", numbers.join(","));
    }
    data += "]};\n";
    TEMPLATE.replacen(PLACE, &data, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_holds_all_and_asks_the_network_for_nothing() {
        let design = Design::new(1, 2, 5);
        let files: Vec<Vec<u8>> = (0..design.items.len()).map(|i| vec![i as u8; 9]).collect();
        let page = page(&design, &files);
        assert_eq!(page.matches("data:image/png;base64,").count(), design.items.len());
        assert!(!page.contains(PLACE) && !page.contains("http"));
        let json = page.split("const STUDY = ").nth(1).and_then(|s| s.split(";\n").next()).expect("the data");
        let data: serde_json::Value = serde_json::from_str(json).expect("JSON");
        assert_eq!(data["orders"][1].as_array().map(Vec::len), Some(design.items.len()));
        assert_eq!(data["pictures"][3][0], "p004");
        // Nothing in it tells which pictures are real.
        assert!(!page.contains("full_as_published") && !page.contains("textured"));
    }
}
