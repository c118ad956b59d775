use super::*;

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawShelf {
    width_mm: OptionalKey<f64>,
    boards: OptionalKey<i64>,
    label: OptionalKey<String>,
    at_m: OptionalKey<Vec<f64>>,
    hung: OptionalKey<bool>,
    made: OptionalKey<BareOrQuoted>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawBook {
    pages: RequiredKey<i64>,
    bound: bool,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawRoom {
    shelf: Option<Spanned<RawShelf>>,
    book: Vec<Spanned<RawBook>>,
}

const RENAMED: [RenamedKey; 1] = [RenamedKey { table: "shelf", old: "wide", new: "width_mm" }];

/// Reads all of a room.
fn read(text: &str) -> Result<(Option<f64>, Vec<String>), TomlError> {
    let text = TomlText::new(text, "room.toml")?;
    let (raw, warnings) = text.read::<RawRoom>(&RENAMED)?;
    let (_, shelf) = text.section("shelf", raw.shelf);
    text.given(&shelf.boards, whole(1..=9u8))?;
    text.given(&shelf.label, plain_text())?;
    text.given(&shelf.at_m, list_of::<2, _, _>(positive(5.0, "m")))?;
    text.given(&shelf.hung, yes_no())?;
    text.given(&shelf.made, date_and_time())?;
    for (_, book) in text.sections("book", raw.book, 2)? {
        text.needed(&book.pages, whole(1..=2000u16))?;
        assert!(book.bound);
    }
    Ok((text.given(&shelf.width_mm, number(100.0..=2000.0, "mm"))?, warnings))
}

fn refused(text: &str) -> String {
    read(text).expect_err("must be refused").to_string()
}

#[test]
fn every_mistake_names_place_key_value_and_what_is_allowed() {
    for (text, said) in [
        (
            "[shelf]\nwidth_mm = 3",
            "room.toml:2:12: shelf.width_mm: 3 is not allowed; give a number, 100 to 2000 mm",
        ),
        (
            "[shelf]\nwidth_mm = \"3\"",
            "room.toml:2:12: shelf.width_mm: \"3\" is not allowed; give a number, 100 to 2000 mm",
        ),
        ("[shelf]\nwidth_mm = nan", "room.toml:2:12: shelf.width_mm: nan is not allowed"),
        (
            "[shelf]\nboards = 99999999999999999999",
            "room.toml:2:10: shelf.boards: 99999999999999999999 is not allowed",
        ),
        (
            "[shelf]\nboards = 10",
            "room.toml:2:10: shelf.boards: 10 is not allowed; give a whole number, 1 to 9",
        ),
        (
            "[shelf]\nat_m = [1, 6]",
            "room.toml:2:8: shelf.at_m: [1, 6] is not allowed; give a list of 2, each a number above 0, up to 5 m",
        ),
        ("[shelf]\nat_m = [1, 2, 3]", "room.toml:2:8: shelf.at_m: [1, 2, 3] is not allowed"),
        ("[shelf]\nhung = 1", "room.toml:2:8: shelf.hung: 1 is not allowed; give true or false"),
        ("[shelf]\nmade = 1", "room.toml:2:8: shelf.made: 1 is not allowed; give a time like"),
        (
            "[shelf]\nlabel = \"a\\u0000\"",
            "room.toml:2:9: shelf.label: \"a\\u0000\" is not allowed; give a text in quotes",
        ),
        (
            "[shelf]\nwitdh_mm = 3",
            "room.toml:2:1: shelf.witdh_mm: unknown key; known are width_mm, boards, label, at_m, hung, made; did \
             you mean width_mm?",
        ),
        ("[shlef]\n", "room.toml:1:2: shlef: unknown key; known are shelf, book; did you mean shelf?"),
        ("[table]\n", "room.toml:1:2: table: unknown key; known are shelf, book"),
        ("shelf = 3", "room.toml:1:9: shelf: 3 is not allowed; give a table: [shelf]"),
        ("book = 3", "room.toml:1:8: book: 3 is not allowed; give a list"),
        ("[[book]]\nbound = true", "room.toml:1:1: book[1].pages: is missing"),
        (
            "[[book]]\npages = 3\nbound = 3",
            "room.toml:3:9: book[1].bound: 3 is not allowed; give true or false",
        ),
        (
            "[[book]]\npages = 3\nbound = true\n[[book]]\npages = 0\nbound = true",
            "room.toml:5:9: book[2].pages: 0 is not allowed",
        ),
        ("[shelf\n", "room.toml:1:7: "),
    ] {
        let shown = refused(text);
        assert!(shown.starts_with(said), "{text:?}\n gave {shown}\n want {said}");
        assert_eq!(shown.lines().count(), 1, "{shown}");
    }
    let book = "[[book]]\npages = 3\nbound = true\n";
    assert!(refused(&book.repeat(3)).starts_with("room.toml:7:1: book: at most 2 tables"));
}

#[test]
fn a_former_name_is_read_with_a_warning_that_names_the_new_one() {
    let (width_mm, warnings) = read("[shelf]\nwide = 800\n").expect("valid");
    assert_eq!(width_mm, Some(800.0));
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].starts_with("room.toml:2:1: shelf.wide: is now called width_mm"), "{}", warnings[0]);
    assert_eq!(read("[shelf]\nwidth_mm = 800\n").expect("valid"), (Some(800.0), vec![]));
    assert!(
        refused("[shelf]\nwidth_mm = 800\nwide = 800")
            .contains("3:1: shelf.wide: is the former name of width_mm")
    );
    // Its value is checked like that of the new name, and the text's own word is told.
    assert!(refused("[shelf]\nwide = 3").starts_with("room.toml:2:8: shelf.wide: 3 is not allowed"));
}

#[test]
fn a_text_beyond_the_limit_is_refused_unread() {
    let long = "#".repeat(TEXT_BYTES_MAX + 1);
    assert!(refused(&long).contains("give at most 1048576"), "{}", refused(&long));
    assert!(read(&long[1..]).is_ok());
}
