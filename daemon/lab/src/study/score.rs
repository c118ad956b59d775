//! `bowwave study score`: rates by factor and d' from people's answers.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use anyhow::{Context, Result, bail};
use bowwave::{outcome::Outcome, stdout};
use serde::{Deserialize, Serialize};

use super::{
    key::{self, FACTORS, KeyRow, TABLE_BYTES_MAX},
    statistics::{AnswerTally, Estimate, d_prime, rate},
};
use crate::cli::StudyScoreArgs;

/// A line of an answer file; further columns are left alone.
#[derive(Clone, Debug, Deserialize)]
struct Answer {
    participant: String,
    picture: String,
    answer: String,
    /// Of the pictures that were shown; empty in files of former versions.
    #[serde(default)]
    study: String,
}

/// The result for one group of pictures.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub struct ScoreLine {
    /// "kind", or a factor.
    pub factor: String,
    /// Level of the factor.
    pub level: String,
    /// Answers.
    pub seen: u32,
    /// Of these, "real".
    pub called_real: u32,
    /// Their share.
    pub rate: f64,
    /// Its standard error.
    pub rate_error: f64,
    /// d' against the real pictures; none for the real ones themselves or where there are none.
    pub d_prime: Option<f64>,
    /// Its standard error.
    pub d_prime_error: Option<f64>,
}

/// Scores the files that the arguments name.
pub fn run(arguments: &StudyScoreArgs) -> Result<Outcome> {
    let key = key::read(&arguments.key)?;
    let mut answers = Answers::new(&key);
    for path in &arguments.answers {
        answers.read(path)?;
    }
    let lines = answers.lines();
    if arguments.json {
        stdout::print_json(&lines)?;
    } else {
        stdout::print(table(&lines))?;
        eprintln!("{} participants", answers.by_participant.len());
    }
    if answers.unmarked > 0 && key.iter().any(|row| !row.study.is_empty()) {
        log::warn!(
            "{} answers do not say of which study they are; check that {} is their key",
            answers.unmarked,
            arguments.key.display()
        );
    }
    let missing = answers.missing();
    if missing > 0 {
        log::warn!("{missing} pictures were not answered; they are left out");
    }
    Ok(if missing > 0 { Outcome::Partly } else { Outcome::Done })
}

/// All answers, checked against the key.
struct Answers<'a> {
    key: BTreeMap<&'a str, &'a KeyRow>,
    by_participant: BTreeMap<String, BTreeMap<&'a str, bool>>,
    /// Answers that do not say of which study they are.
    unmarked: usize,
}

impl<'a> Answers<'a> {
    fn new(key: &'a [KeyRow]) -> Self {
        let key = key.iter().map(|row| (row.picture.as_str(), row)).collect();
        Self { key, by_participant: BTreeMap::new(), unmarked: 0 }
    }

    fn read(&mut self, path: &Path) -> Result<()> {
        let told = || format!("cannot read the answers {}", path.display());
        let text = bowwave_files::plain_text(path, TABLE_BYTES_MAX).with_context(told)?;
        self.take(text.as_bytes(), &path.display().to_string())
    }

    fn take(&mut self, input: impl std::io::Read, origin: &str) -> Result<()> {
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(input);
        let header = reader.headers().with_context(|| format!("cannot read the answers {origin}"))?;
        for column in ["participant", "picture", "answer"] {
            if !header.iter().any(|h| h == column) {
                bail!(
                    "{origin}:1: no column '{column}'; the page's own file has participant, picture and answer"
                );
            }
        }
        let mut known = 0;
        for (index, answer) in reader.deserialize::<Answer>().enumerate() {
            let line = index + 2;
            let answer = answer.map_err(|e| anyhow::anyhow!("{origin}:{line}: {}", one_line(&e)))?;
            let called_real = match answer.answer.to_ascii_lowercase().as_str() {
                "" => continue,
                "real" | "r" => true,
                "generated" | "not real" | "g" | "n" => false,
                other => {
                    bail!("{origin}:{line}: '{other}' is no answer; write real or generated, or nothing")
                }
            };
            let Some((&picture, row)) = self.key.get_key_value(answer.picture.as_str()) else {
                bail!("{origin}:{line}: no picture '{}' in the key; is it another study's?", answer.picture);
            };
            if !answer.study.is_empty() && !row.study.is_empty() && answer.study != row.study {
                bail!(
                    "{origin}:{line}: an answer to study {}, and the key is of study {}; name its own key with --key",
                    answer.study,
                    row.study
                );
            }
            self.unmarked += usize::from(answer.study.is_empty());
            if answer.participant.is_empty() {
                bail!("{origin}:{line}: no participant");
            }
            let of = self.by_participant.entry(answer.participant.clone()).or_default();
            if of.insert(picture, called_real).is_some() {
                bail!(
                    "{origin}:{line}: participant {} answers {picture} twice; give each participant a number",
                    answer.participant
                );
            }
            known += 1;
        }
        if known == 0 {
            bail!("{origin} holds no answer");
        }
        Ok(())
    }

    /// Pictures that participants who answered at all did not answer.
    fn missing(&self) -> usize {
        self.by_participant.values().map(|answers| self.key.len() - answers.len()).sum()
    }

    /// Each participant's answers to the pictures that `belongs` picks.
    fn tallies(&self, belongs: impl Fn(&KeyRow) -> bool) -> Vec<AnswerTally> {
        let of = |answers: &BTreeMap<&str, bool>| {
            let mut tally = AnswerTally::default();
            for (picture, &called_real) in answers {
                if self.key.get(picture).is_some_and(|row| belongs(row)) {
                    tally.add(called_real);
                }
            }
            tally
        };
        self.by_participant.values().map(of).collect()
    }

    fn line(&self, factor: &str, level: &str, belongs: impl Fn(&KeyRow) -> bool) -> Option<ScoreLine> {
        let tallies = self.tallies(belongs);
        let Estimate { value, error } = rate(&tallies)?;
        let all = tallies.into_iter().fold(AnswerTally::default(), AnswerTally::plus);
        let real = self.tallies(is_real).into_iter().fold(AnswerTally::default(), AnswerTally::plus);
        let d = if level == "real" { None } else { d_prime(real, all) };
        Some(ScoreLine {
            factor: factor.to_owned(),
            level: level.to_owned(),
            seen: all.seen,
            called_real: all.real,
            rate: value,
            rate_error: error,
            d_prime: d.map(|d| d.value),
            d_prime_error: d.map(|d| d.error),
        })
    }

    fn lines(&self) -> Vec<ScoreLine> {
        let mut lines: Vec<ScoreLine> = Vec::new();
        lines.extend(self.line("kind", "real", is_real));
        lines.extend(self.line("kind", "generated", |row| !is_real(row)));
        for (factor, level_of) in FACTORS {
            let levels: BTreeSet<&str> =
                self.key.values().filter(|row| !is_real(row)).map(|row| level_of(row)).collect();
            for level in levels {
                lines.extend(self.line(factor, level, |row| !is_real(row) && level_of(row) == level));
            }
        }
        lines
    }
}

fn is_real(row: &KeyRow) -> bool {
    row.kind == "real"
}

fn one_line(error: &csv::Error) -> String {
    error.to_string().replace('\n', " ")
}

fn table(lines: &[ScoreLine]) -> String {
    let mut text = format!(
        "{:<11} {:<16} {:>5} {:>7} {:>6} {:>6} {:>6}\n",
        "factor", "level", "seen", "real %", "+-", "d'", "+-"
    );
    for line in lines {
        let d = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"));
        text += &format!(
            "{:<11} {:<16} {:>5} {:>7.1} {:>6.1} {:>6} {:>6}\n",
            line.factor,
            line.level,
            line.seen,
            100.0 * line.rate,
            100.0 * line.rate_error,
            d(line.d_prime),
            d(line.d_prime_error)
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key() -> Vec<KeyRow> {
        let row = |picture: &str, kind: &str, method: &str, shadow: &str| KeyRow {
            picture: picture.into(),
            kind: kind.into(),
            method: method.into(),
            shadow: shadow.into(),
            background: if kind == "real" { "" } else { "sea" }.into(),
            boat_type: if kind == "real" { "" } else { "virtual" }.into(),
            source: String::new(),
            study: "5ea51de5".into(),
        };
        vec![
            row("p001", "real", "", ""),
            row("p002", "real", "", ""),
            row("p003", "generated", "full", "on"),
            row("p004", "generated", "full", "off"),
            row("p005", "generated", "mirror", "on"),
            row("p006", "generated", "mirror", "off"),
        ]
    }

    const TWO: &str = "participant,position,picture,answer,ms\n1,1,p001,real,900\n1,2,p003,real,800\n1,3,p002,real,1\n\
                       1,4,p004,generated,1\n1,5,p005,generated,1\n1,6,p006,generated,1\n2,1,p001,real,1\n\
                       2,2,p002,generated,1\n2,3,p003,real,1\n2,4,p004,real,1\n2,5,p005,real,1\n2,6,p006,generated,1\n";

    #[test]
    fn rates_by_factor_by_hand() {
        let key = key();
        let mut answers = Answers::new(&key);
        answers.take(TWO.as_bytes(), "answers.csv").expect("sound answers");
        assert_eq!(answers.missing(), 0);
        let lines = answers.lines();
        let find = |factor: &str, level: &str| {
            lines.iter().find(|l| l.factor == factor && l.level == level).expect("a line").clone()
        };
        // Real: 2/2 and 1/2. Generated: 1/4 and 3/4. Spread of two rates half apart: 0.25.
        let real = find("kind", "real");
        assert_eq!((real.seen, real.called_real, real.d_prime), (4, 3, None));
        assert!((real.rate_error - 0.25).abs() < 1e-12, "{real:?}");
        let generated = find("kind", "generated");
        assert_eq!((generated.rate, generated.rate_error), (0.5, 0.25));
        // z(3/4) - z(1/2).
        assert!((generated.d_prime.expect("d'") - 0.674_49).abs() < 1e-4);
        assert_eq!((find("method", "full").rate, find("method", "mirror").rate), (0.75, 0.25));
        assert_eq!((find("shadow", "on").rate, find("shadow", "off").rate), (0.75, 0.25));
        // z(3/4) - z(1/4).
        assert!((find("method", "mirror").d_prime.expect("d'") - 1.348_98).abs() < 1e-4);
        assert!(table(&lines).contains("mirror"));
    }

    #[test]
    fn answers_that_do_not_fit_are_named_by_line() {
        let key = key();
        let refuse = |text: &str| {
            Answers::new(&key).take(text.as_bytes(), "a.csv").expect_err("it must be refused").to_string()
        };
        let head = "participant,picture,answer\n";
        for (text, words) in [
            ("participant,picture\n1,p001\n".to_owned(), "a.csv:1: no column 'answer'"),
            (format!("{head}1,p001,maybe\n"), "a.csv:2: 'maybe'"),
            (format!("{head}1,p001,real\n1,p999,real\n"), "a.csv:3: no picture 'p999'"),
            (format!("{head}1,p001,real\n1,p001,real\n"), "a.csv:3: participant 1 answers p001 twice"),
            (format!("{head},p001,real\n"), "a.csv:2: no participant"),
            (format!("{head}1,p001\n"), "a.csv:2:"),
            (format!("{head}1,p001,\n"), "a.csv holds no answer"),
            (String::new(), "a.csv"),
        ] {
            let said = refuse(&text);
            assert!(said.contains(words) && !said.contains('\n'), "'{words}' not in: {said}");
        }
    }

    #[test]
    fn answers_to_another_study_are_refused() {
        let key = key();
        let take = |study: &str| {
            let text = format!("participant,picture,answer,study\n1,p001,real,{study}\n");
            let mut answers = Answers::new(&key);
            answers.take(text.as_bytes(), "a.csv").map(|()| answers.unmarked).map_err(|e| e.to_string())
        };
        assert_eq!(take("5ea51de5"), Ok(0));
        assert_eq!(take(""), Ok(1));
        let said = take("0ther000").expect_err("it must be refused");
        assert!(said.starts_with("a.csv:2: an answer to study 0ther000"), "{said}");
    }

    #[test]
    fn what_was_not_answered_is_left_out() {
        let key = key();
        let mut answers = Answers::new(&key);
        answers.take("participant,picture,answer\nA,p001,R\nA,p003,n\n".as_bytes(), "a.csv").expect("sound");
        assert_eq!(answers.missing(), 4);
        let lines = answers.lines();
        assert!(lines.iter().all(|l| l.rate.is_finite() && l.rate_error.is_finite()), "{lines:?}");
        assert!(!lines.iter().any(|l| l.level == "mirror"), "nothing is said of what nobody answered");
    }
}
