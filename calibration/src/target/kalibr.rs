//! Boards as Kalibr describes them: a file (YAML) with `target_type: 'aprilgrid'`, `tagCols`, `tagRows`, `tagSize` in metres and
//! `tagSpacing` by that, so that a board which somebody owns is used as it is.

use saphyr::{LoadableYamlNode as _, MarkedYaml};

use super::{Target, TargetError};

/// Keys of such a file.
const FORM: &str = "a board's file has target_type: 'aprilgrid', tagCols, tagRows, tagSize (metres) and tagSpacing, each in a line of \
                    its own";

/// Why a file describes no board that can be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KalibrError {
    /// Not of that form.
    #[error("{0}; {FORM}")]
    Form(String),
    /// Another kind of board.
    #[error(
        "a board of the type '{0}', of which only 'aprilgrid' is read; `bowwave calibrate board` makes one to print"
    )]
    Kind(String),
    /// Tags of other numbers.
    #[error(
        "line {0}, column {1}: codeOffset: only boards whose first tag is number 0 are read; `bowwave calibrate board` makes one to print"
    )]
    Offset(usize, usize),
    /// Numbers that cannot be.
    #[error("{0}; tagSize is in metres")]
    Size(#[from] TargetError),
}

impl Target {
    /// The board of a file of Kalibr's. Keys that say nothing of the board are passed over, as Kalibr does.
    ///
    /// # Errors
    /// Where the text is none, or of another board; with line and column where it has them.
    pub fn of_kalibr(text: &str) -> Result<Self, KalibrError> {
        let documents = MarkedYaml::load_from_str(text).map_err(|e| {
            let at = e.marker();
            KalibrError::Form(format!("line {}, column {}: {}", at.line(), at.col() + 1, e.info()))
        })?;
        let file = documents.first().ok_or_else(|| KalibrError::Form("it is empty".to_owned()))?;
        let kind = wanted(file, "target_type", "a word", |v| v.data.as_str().map(str::to_owned))?;
        if kind != "aprilgrid" {
            return Err(KalibrError::Kind(kind));
        }
        let whole = |v: &MarkedYaml<'_>| v.data.as_integer().and_then(|n| usize::try_from(n).ok());
        let number =
            |v: &MarkedYaml<'_>| v.data.as_floating_point().or_else(|| Some(v.data.as_integer()? as f64));
        if let Some(offset) = file.data.as_mapping_get("codeOffset").filter(|v| whole(v) != Some(0)) {
            let at = offset.span.start;
            return Err(KalibrError::Offset(at.line(), at.col() + 1));
        }
        Ok(Self::new(
            wanted(file, "tagCols", "a whole number", whole)?,
            wanted(file, "tagRows", "a whole number", whole)?,
            wanted(file, "tagSize", "a number", number)?,
            wanted(file, "tagSpacing", "a number", number)?,
        )?)
    }

    /// The board as a file of Kalibr's.
    pub fn to_kalibr(&self) -> String {
        format!(
            "target_type: 'aprilgrid'  # tags of the family 36h11, number 0 at the lower left\ntagCols: {}\ntagRows: {}\n\
             tagSize: {}  # side of a tag's black square, metres\ntagSpacing: {}  # gap between tags by that side\ncodeOffset: 0\n",
            self.columns, self.rows, self.tag_m, self.spacing
        )
    }
}

/// The value of a key that must be there.
fn wanted<T>(
    file: &MarkedYaml<'_>,
    key: &str,
    what: &str,
    read: impl Fn(&MarkedYaml<'_>) -> Option<T>,
) -> Result<T, KalibrError> {
    let value = file
        .data
        .as_mapping_get(key)
        .ok_or_else(|| KalibrError::Form(format!("line {}: {key} is missing", file.span.start.line())))?;
    let at = value.span.start;
    read(value).ok_or_else(|| {
        KalibrError::Form(format!("line {}, column {}: {key} is not {what}", at.line(), at.col() + 1))
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// As Kalibr's own wiki has it.
    const USUAL: &str = "target_type: 'aprilgrid' #gridtype\ntagCols: 6               #number of apriltags\n\
        tagRows: 5               #number of apriltags\ntagSize: 0.088           #size of apriltag, edge to edge [m]\n\
        tagSpacing: 0.3          #ratio of space between tags to tagSize\n\
                                 #example: tagSize=2m, spacing=0.5m --> tagSpacing=0.25[-]\n";

    #[test]
    fn kalibrs_own_file_is_read() {
        assert_eq!(Target::of_kalibr(USUAL), Ok(Target::new(6, 5, 0.088, 0.3).unwrap()));
        // As others write it.
        let other = "%YAML 1.2\n---\n{target_type: aprilgrid, tagCols: 6, tagRows: 5, tagSize: 88.0e-3, tagSpacing: 0.3, low_id: 0}";
        assert_eq!(Target::of_kalibr(other), Target::of_kalibr(USUAL));
    }

    #[test]
    fn what_is_no_board_says_what_where_and_what_to_do() {
        for (from, to, words) in [
            (
                "tagCols: 6 ",
                "tagCols: six",
                &["line 2, column 10: tagCols is not a whole number", "tagSize (metres)"][..],
            ),
            ("tagRows: 5 ", "tagrows: 5 ", &["tagRows is missing", "tagSize (metres)"]),
            ("tagSize: 0.088", "tagSize: 88 ", &["88000.0 mm", "tagSize is in metres"]),
            ("tagSpacing: 0.3", "tagSpacing: -.3", &["0.1 to 1", "metres"]),
            ("'aprilgrid'", "'checkerboard'", &["'checkerboard'", "bowwave calibrate board"]),
            (
                "tagCols",
                "codeOffset: 9\ntagCols",
                &["line 2, column 13: codeOffset", "bowwave calibrate board"],
            ),
            ("target_type: 'aprilgrid'", "target_type: 'aprilgrid", &["line ", "a board's file has"]),
        ] {
            let text = USUAL.replacen(from, to, 1);
            assert_ne!(text, USUAL, "{from}");
            let error = Target::of_kalibr(&text).unwrap_err().to_string();
            for word in words {
                assert!(error.contains(word), "'{word}' is missing: {error}");
            }
            assert!(!error.contains('\n'), "{error}");
        }
        assert!(Target::of_kalibr("").is_err());
    }

    proptest! {
        #[test]
        fn a_board_survives_its_file(columns in 1_usize..20, rows in 1_usize..20, tag_mm in 1.0..2000.0, spacing in 0.1..1.0) {
            let target = Target::new(columns, rows, tag_mm / 1e3, spacing).unwrap();
            prop_assert_eq!(Target::of_kalibr(&target.to_kalibr()), Ok(target));
        }

        #[test]
        fn nothing_from_outside_panics(text in "\\PC{0,60}", value in "[-+0-9a-z.'{\\[]{0,12}") {
            let _ = Target::of_kalibr(&text);
            let _ = Target::of_kalibr(&USUAL.replacen("0.088", &value, 1));
        }
    }
}
