//! The page.

use std::sync::LazyLock;

use bowwave_core::order::{MESSAGE_BYTES_MAX, NOTE_BYTES_MAX};
use maud::{DOCTYPE, Markup, html};

/// The page as HTML. It is the same for everybody: what differs comes over the WebSocket.
pub(crate) fn html() -> &'static str {
    static PAGE: LazyLock<String> = LazyLock::new(|| page().into_string());
    &PAGE
}

fn page() -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" data-obc-theme="day" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "Bowwave instructor" }
                link rel="icon" href="data:,";
                link rel="stylesheet" href="/assets/look.css";
                link rel="stylesheet" href="/assets/instructor.css";
                script type="module" src="/assets/main.js" {}
            }
            body {
                a.skip href="#commands" { "To the commands" }
                (header())
                p.strip id="strip" role="alert" hidden {}
                noscript { p.strip { "This page needs JavaScript." } }
                main {
                    (picture())
                    (chart())
                    (side())
                    (commands())
                    (boats())
                    (scenarios())
                    (inject())
                    (words())
                    (runs())
                }
                div.visually-hidden id="spoken" role="status" aria-live="polite" {}
                (login())
                (help())
            }
        }
    }
}

fn header() -> Markup {
    html! {
        header.bar {
            div.title {
                h1 id="scenario" { "Bowwave instructor" }
                p.muted id="clock" { "no exercise" }
            }
            div.state role="status" aria-label="State of the trainer" {
                span.badge id="word" { "NO NEWS" }
                span id="cause" {}
            }
            dl.facts {
                div { dt { "Rules" } dd id="rules" { "-" } }
                div { dt { "Weapon" } dd id="weapon" { "-" } }
                div { dt { "Rounds left" } dd.number id="rounds" { "-" } }
                div { dt { "Hits" } dd.number id="hits" { "-" } }
            }
            div.holder role="group" aria-label="Control" {
                span id="holder" { "nobody has control" }
                button type="button" id="control" aria-keyshortcuts="K" { "Take control " kbd { "K" } }
                button type="button" id="session" { "Log in" }
            }
            div.tools {
                label { span.visually-hidden { "Light" } select id="theme" {
                    @for (value, name) in [("day", "Day"), ("bright", "Bright"), ("dusk", "Dusk"), ("night", "Night")] {
                        option value=(value) { (name) }
                    }
                } }
                button type="button" id="help-open" aria-label="Help and keys" aria-keyshortcuts="?" { "?" }
            }
        }
    }
}

fn picture() -> Markup {
    html! {
        section.panel.picture aria-labelledby="picture-title" {
            div.head { h2 id="picture-title" { "Live picture" } span.figure id="delay" { "-" } }
            div.frame {
                canvas id="picture" role="img" aria-label="What the trainee sees" width="1280" height="720" {}
                p.over id="picture-note" { "no picture yet" }
            }
        }
    }
}

fn chart() -> Markup {
    html! {
        section.panel.chart aria-labelledby="chart-title" {
            div.head {
                h2 id="chart-title" { "Chart" }
                span.muted id="chart-scale" {}
                span.tools {
                    button type="button" id="chart-out" aria-label="Wider" aria-keyshortcuts="-" { "\u{2212}" }
                    button type="button" id="chart-in" aria-label="Closer" aria-keyshortcuts="+" { "+" }
                }
            }
            canvas id="chart" role="img" aria-label="Chart about the gun, north up: boats, bearing and field of view. The table of boats says the same in words." {}
            p.muted.legend { "\u{25b2} hostile  \u{25a0} neutral  \u{2715} struck" }
        }
    }
}

fn side() -> Markup {
    html! {
        div.side tabindex="0" role="region" aria-label="Devices and score" {
            section.panel aria-labelledby="devices-title" {
                h2 id="devices-title" { "Devices" }
                ul.devices id="devices" { li.muted { "no news yet" } }
            }
            section.panel.score aria-labelledby="score-title" {
                div.head { h2 id="score-title" { "Score" } span.badge id="points" { "-" } }
                p.muted id="score-note" { "no score yet" }
                table { tbody id="score" {} }
            }
        }
    }
}

/// Label, key, and the command that the button sends.
type Row = (&'static str, &'static str, &'static str);

fn commands() -> Markup {
    const CALLS: [Row; 4] = [
        ("Detected", "D", r#"{"kind":"act","act":"report"}"#),
        ("Hostile", "H", r#"{"kind":"act","act":{"identify":"hostile"}}"#),
        ("Neutral", "N", r#"{"kind":"act","act":{"identify":"neutral"}}"#),
        ("Warned", "W", r#"{"kind":"act","act":"warn"}"#),
    ];
    const RULES: [Row; 3] = [
        ("Weapons free", "F", r#"{"kind":"order","order":{"order":"rules","rules":"free"}}"#),
        ("Weapons tight", "T", r#"{"kind":"order","order":{"order":"rules","rules":"tight"}}"#),
        ("Cease fire", "C", r#"{"kind":"order","order":{"order":"rules","rules":"hold"}}"#),
    ];
    const WEAPON: [Row; 1] = [("Stoppage", "S", r#"{"kind":"order","order":{"order":"stoppage"}}"#)];
    let group = |name: &str, rows: &[Row]| {
        html! {
            div.group role="group" aria-label=(name) {
                span.muted aria-hidden="true" { (name) }
                div.keys { @for (label, key, command) in rows {
                    button type="button" data-key=(key) data-command=(command) aria-keyshortcuts=(key) { (label) " " kbd { (key) } }
                } }
            }
        }
    };
    html! {
        section.panel.commands id="commands" tabindex="-1" aria-label="Commands" {
            (group("Calls of the trainee", &CALLS))
            (group("Weapon", &WEAPON))
            (group("Rules of engagement", &RULES))
            div.group role="group" aria-label="Exercise" {
                span.muted aria-hidden="true" { "Exercise" }
                div.keys {
                    button type="button" id="pause" data-key="P" aria-keyshortcuts="P" { span { "Pause" } " " kbd { "P" } }
                    button type="button" id="reset" { "Reset" }
                    button type="button" id="stand-by" { "Stand by" }
                }
            }
        }
    }
}

fn boats() -> Markup {
    html! {
        section.panel.boats aria-labelledby="boats-title" {
            h2 id="boats-title" { "Boats" }
            div.scroll tabindex="0" role="region" aria-label="Table of boats" { table { thead id="boats-head" {} tbody id="boats" {} } }
        }
    }
}

fn scenarios() -> Markup {
    html! {
        section.panel.scenarios aria-labelledby="scenarios-title" {
            div.head {
                h2 id="scenarios-title" { "Scenarios" }
                span.muted id="scenarios-note" { "log in to see them" }
            }
            div.library {
                label.list { span.visually-hidden { "Scenarios" } select id="scenario-list" size="9" {} }
                div.about {
                    h3 id="about-title" { "No scenario is chosen" }
                    p.muted id="about-facts" {}
                    p.briefing id="about-briefing" {}
                    ul.mistakes id="mistakes" aria-live="polite" {}
                }
                canvas id="preview" role="img" aria-label="Boats as the scenario begins" {}
            }
            div.tools {
                label { "Time of day " select id="day" {
                    @for (value, name) in [("written", "as written"), ("day", "day"), ("dusk", "dusk"), ("night", "night")] { option value=(value) { (name) } }
                } }
                button.strong type="button" id="start" { "Start" }
                span.muted id="start-note" role="status" {}
                button type="button" id="edit" aria-expanded="false" aria-controls="editor" { "Edit" }
            }
            div.editor id="editor" hidden {
                div.text {
                    pre.gutter id="gutter" aria-hidden="true" { "1" }
                    label { span.visually-hidden { "Text of the scenario" }
                        textarea id="scenario-text" spellcheck="false" autocapitalize="off" autocomplete="off" wrap="off" rows="18" {} }
                }
                div.tools {
                    button type="button" id="check" { "Check" }
                    label { "Name " input type="text" id="save-name" maxlength="64" pattern="[a-z0-9\\-]{1,64}" autocomplete="off" placeholder="my-scenario"; }
                    button type="button" id="save" { "Save" }
                }
            }
        }
    }
}

fn inject() -> Markup {
    html! {
        section.panel.inject aria-labelledby="inject-title" {
            h2 id="inject-title" { "Boats in reserve" }
            p.muted id="reserve-note" { "the scenario has none" }
            form id="inject-form" {
                label { "Boat" select id="reserve" required {} }
                label { "Bearing, degrees" input type="number" id="inject-bearing" min="0" max="360" step="any" placeholder="as written"; }
                label { "Range, m" input type="number" id="inject-range" min="50" max="20000" step="any" placeholder="as written"; }
                button type="submit" { "Let it join" }
            }
        }
    }
}

fn words() -> Markup {
    html! {
        section.panel.words aria-labelledby="words-title" {
            h2 id="words-title" { "Text" }
            form id="message-form" {
                label { "For the trainee, on the LCD" input type="text" id="message" maxlength=(MESSAGE_BYTES_MAX) required autocomplete="off" aria-keyshortcuts="M"; }
                button type="submit" { "Show" }
            }
            p.muted { "On the LCD: " span id="shown" { "nothing" } }
            form id="note-form" {
                label { "Note for the debrief" input type="text" id="note" maxlength=(NOTE_BYTES_MAX) required autocomplete="off" aria-keyshortcuts="O"; }
                button type="submit" { "Keep" }
            }
            h3 { "Messages" }
            ol.log id="log" tabindex="0" aria-label="Messages, the newest first" {}
        }
    }
}

fn runs() -> Markup {
    html! {
        section.panel.runs aria-labelledby="runs-title" {
            div.head { h2 id="runs-title" { "Runs" } button type="button" id="runs-load" { "Load the list" } }
            p.muted id="runs-note" {}
            div.scroll tabindex="0" role="region" aria-label="Table of runs" { table id="runs" {} }
        }
    }
}

fn login() -> Markup {
    html! {
        dialog id="login" aria-labelledby="login-title" {
            form id="login-form" method="dialog" {
                h2 id="login-title" { "Log in" }
                p { "Everybody may watch. Whoever has a token may take control." }
                label { "Token" input type="password" id="token" autocomplete="off" spellcheck="false" maxlength="200"; }
                p.wrong id="login-note" role="alert" {}
                div.tools { button.strong type="submit" { "Log in" } button type="button" id="login-cancel" { "Cancel" } }
            }
        }
    }
}

fn help() -> Markup {
    const KEYS: [(&str, &str); 16] = [
        ("D", "the trainee reported what the gun points at"),
        ("H", "the trainee called it hostile"),
        ("N", "the trainee called it neutral"),
        ("W", "the trainee warned it"),
        ("F", "weapons free: all but neutral boats may be fired at"),
        ("T", "weapons tight: only boats that were called hostile"),
        ("C", "cease fire: no round but in self-defence"),
        ("S", "stoppage with the next round"),
        ("P", "pause, and go on"),
        ("K", "take control, and hand it back"),
        ("M", "to the text for the trainee"),
        ("O", "to the note for the debrief"),
        ("+", "chart closer"),
        ("-", "chart wider"),
        ("?", "this help"),
        ("Esc", "leave a field or this help"),
    ];
    html! {
        dialog id="help" aria-labelledby="help-title" {
            h2 id="help-title" { "Keys" }
            table { tbody { @for (key, meaning) in KEYS { tr { th { kbd { (key) } } td { (meaning) } } } } }
            p.muted { "Calls are about the boat that the gun points at. Keys do nothing while a field is being filled in." }
            label.switch { input type="checkbox" id="keys" checked; " Single keys give commands" }
            div.tools { button type="button" id="help-close" { "Close" } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse_command;

    #[test]
    fn buttons_send_commands_and_each_has_its_key() {
        let page = html();
        let mut keys = Vec::new();
        for part in page.split("data-command=\"").skip(1) {
            let command = part.split('"').next().unwrap().replace("&quot;", "\"");
            assert!(parse_command(command.as_bytes()).is_ok(), "{command}");
        }
        for part in page.split("data-key=\"").skip(1) {
            keys.push(part.split('"').next().unwrap());
        }
        let count = keys.len();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!((count, keys.len()), (9, 9));
    }

    #[test]
    fn nothing_in_the_page_runs_or_is_fetched_from_elsewhere() {
        let page = html();
        assert_eq!(page.matches("<script").count(), 1);
        for word in ["http:", "https:", "style=", " onclick", "javascript:"] {
            assert!(!page.contains(word), "{word}");
        }
    }
}
