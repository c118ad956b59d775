//! Boats composed into photographs, as a user does it: the example scene and a picture, and everything that can be wrong with them.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::{
    fs,
    path::{Path, PathBuf},
};

use bowwave_core::water::ReflectionMethod;
use bowwave_tests::{bowwave, expect_code, said, write};
use image::{Rgb, RgbImage};

/// A bright sky over a darker sea; the horizon lies in the middle.
fn seascape(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let ripple = ((x * 7 + y * 13) % 11) as u8;
        if y < height / 2 { Rgb([150, 180, 215]) } else { Rgb([40 + ripple, 70 + ripple, 85 + ripple]) }
    })
}

/// A scene of two boats over `picture`.
fn scene(picture: &str) -> String {
    format!(
        "picture = \"{picture}\"\n[camera]\neye_height_m = 4\nhfov_deg = 50\npitch_deg = 0\n\
         [[boat]]\nmodel = \"skiff\"\nrange_m = 25\nbearing_deg = -5\nheading_deg = 80\n\
         [[boat]]\nmodel = \"frigate-quad\"\nrange_m = 400\nbearing_deg = 6\nheading_deg = 90\n\
         [sea]\nbeaufort = 1\n"
    )
}

fn compose(scene: &str, out: &Path, further: &[&str]) -> std::process::Output {
    let out = out.to_str().expect("a plain path");
    bowwave(["compose", scene, "--out", out].into_iter().chain(further.iter().copied()))
}

fn opened(path: PathBuf) -> RgbImage {
    image::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).into_rgb8()
}

/// Share of pixels that differ, of rows `from` to before `to`.
fn changed(a: &RgbImage, b: &RgbImage, from: u32, to: u32) -> f64 {
    let rows = || (from..to).flat_map(|y| (0..a.width()).map(move |x| (x, y)));
    rows().filter(|&(x, y)| a.get_pixel(x, y) != b.get_pixel(x, y)).count() as f64 / rows().count() as f64
}

/// Requires one line of complaint with all of `words`.
fn refused(output: &std::process::Output, words: &[&str]) {
    expect_code(output, 1);
    let said = said(output);
    let lines: Vec<&str> = said.lines().filter(|l| l.starts_with("bowwave: ")).collect();
    assert_eq!(lines.len(), 1, "{said}");
    for word in words {
        assert!(lines[0].contains(word), "'{word}' is missing: {said}");
    }
}

#[test]
fn the_example_and_a_photograph_are_enough() {
    let folder = tempfile::tempdir().expect("a folder");
    let example = bowwave(["compose", "--example"]);
    expect_code(&example, 0);
    let scene = write(folder.path(), "scene.toml", &String::from_utf8(example.stdout).expect("text"));
    let photo = seascape(1280, 720);
    photo.save(folder.path().join("holiday.jpg")).expect("a photograph");
    let out = folder.path().join("out");
    expect_code(&compose(&scene, &out, &["--method", "all", "--validation"]), 0);
    let drawn = |method: ReflectionMethod| opened(out.join(format!("holiday.{}.png", method.name())));
    let off = drawn(ReflectionMethod::Off);
    assert_eq!(off.dimensions(), (1280, 720));
    let original = opened(folder.path().join("holiday.jpg"));
    assert_eq!(changed(&off, &original, 0, 200), 0.0, "the sky is the photograph's own, to the code");
    assert!(changed(&off, &original, 300, 720) > 0.005, "no boat is seen");
    for method in ReflectionMethod::ALL.into_iter().filter(|m| *m != ReflectionMethod::Off) {
        let share = changed(&drawn(method), &off, 400, 720);
        assert!(share > 0.002, "{} draws no reflection: {share}", method.name());
    }
}

#[test]
fn pictures_of_odd_sizes_are_drawn_in_their_own_size() {
    let folder = tempfile::tempdir().expect("a folder");
    let pictures = folder.path().join("pictures");
    fs::create_dir(&pictures).expect("a folder");
    let sizes = [(16, 16), (641, 479), (97, 333), (700, 17)];
    for (i, (width, height)) in sizes.into_iter().enumerate() {
        seascape(width, height).save(pictures.join(format!("picture{}.png", i + 8))).expect("a picture");
    }
    let scene = write(folder.path(), "scene.toml", &scene("pictures"));
    let out = folder.path().join("out");
    let output = compose(&scene, &out, &[]);
    expect_code(&output, 0);
    for (i, size) in sizes.into_iter().enumerate() {
        assert_eq!(opened(out.join(format!("picture{}.png", i + 8))).dimensions(), size);
    }
    // In the order that people expect: 9 before 10.
    let listed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(listed.find("picture9.png") < listed.find("picture10.png"), "{listed}");
}

#[test]
fn a_photograph_is_turned_as_its_camera_was_held() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut jpeg = std::io::Cursor::new(Vec::new());
    seascape(320, 200).write_to(&mut jpeg, image::ImageFormat::Jpeg).expect("a JPEG");
    // Exif after the start marker: one entry, orientation 6 (turn right to look at it).
    let tiff = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let mut bytes = jpeg.get_ref()[..2].to_vec();
    bytes.extend([0xFF, 0xE1, 0, (tiff.len() + 8) as u8]);
    bytes.extend(b"Exif\0\0");
    bytes.extend(tiff);
    bytes.extend(&jpeg.get_ref()[2..]);
    fs::write(folder.path().join("turned.jpg"), bytes).expect("a file");
    let scene = write(folder.path(), "scene.toml", &scene("turned.jpg"));
    let out = folder.path().join("out");
    expect_code(&compose(&scene, &out, &[]), 0);
    assert_eq!(opened(out.join("turned.png")).dimensions(), (200, 320));
}

#[test]
fn mistakes_in_a_scene_are_named_by_line_and_column() {
    let folder = tempfile::tempdir().expect("a folder");
    seascape(320, 200).save(folder.path().join("sea.png")).expect("a picture");
    let sound = scene("sea.png");
    let cases: &[(String, &[&str])] = &[
        (
            sound.replace("eye_height_m = 4", "eye_height_m = 1e12"),
            &["scene.toml:3:16", "1e12", "0.2 to 500 m"],
        ),
        (sound.replace("hfov_deg", "hfov"), &["scene.toml:4:1", "unknown key", "hfov_deg"]),
        (sound.replace("range_m = 25", "range_m = 2"), &["scene.toml:8:11", "farther off"]),
        (sound.replace("\"skiff\"", "\"submarine\""), &["submarine", "skiff"]),
        (
            sound.replace("range_m = 25\nbearing_deg = -5", "waterline_px = [10, 10]"),
            &["scene.toml:8:16", "horizon"],
        ),
        (
            sound.replace("range_m = 25\nbearing_deg = -5", "waterline_px = [900, 150]"),
            &["outside", "320x200"],
        ),
        (sound.replace("pitch_deg = 0", "horizon = [[0, 90], [319, 8000]]"), &["scene.toml:5:11", "outside"]),
        (sound.replace("hfov_deg = 50\n", ""), &["focal", "give focal_35mm_mm"]),
        (sound.replace("sea.png", "lake.png"), &["lake.png", "correct picture"]),
        ("picture = ".to_owned(), &["scene.toml:1:"]),
        (String::new(), &["scene.toml:1:1", "picture", "missing"]),
    ];
    for (text, words) in cases {
        let scene = write(folder.path(), "scene.toml", text);
        refused(&compose(&scene, &folder.path().join("out"), &[]), words);
    }
}

#[test]
fn pictures_that_are_none_are_refused_in_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = {
        let mut png = std::io::Cursor::new(Vec::new());
        seascape(320, 200).write_to(&mut png, image::ImageFormat::Png).expect("a PNG");
        png.into_inner()
    };
    // A PNG header that promises 60000 x 60000 pixels.
    let mut huge = whole.clone();
    huge[16..24].copy_from_slice(&[0, 0, 0xEA, 0x60, 0, 0, 0xEA, 0x60]);
    let tiny = {
        let mut png = std::io::Cursor::new(Vec::new());
        seascape(1, 1).write_to(&mut png, image::ImageFormat::Png).expect("a PNG");
        png.into_inner()
    };
    let cases: [(&str, &[u8]); 5] = [
        ("empty.png", b""),
        ("text.jpg", b"this is no picture at all"),
        ("cut.png", &whole[..whole.len() / 2]),
        ("huge.png", &huge),
        ("tiny.png", &tiny),
    ];
    for (name, bytes) in cases {
        fs::write(folder.path().join(name), bytes).expect("a file");
        let scene = write(folder.path(), "scene.toml", &scene(name));
        refused(&compose(&scene, &folder.path().join("out"), &[]), &[name]);
    }
    fs::create_dir(folder.path().join("nothing")).expect("a folder");
    let scene = write(folder.path(), "scene.toml", &scene("nothing"));
    refused(&compose(&scene, &folder.path().join("out"), &[]), &["nothing", "no JPEG or PNG"]);
}

#[test]
fn the_photograph_itself_is_never_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    seascape(320, 200).save(folder.path().join("sea.png")).expect("a picture");
    let before = fs::read(folder.path().join("sea.png")).expect("the picture");
    let scene = write(folder.path(), "scene.toml", &scene("sea.png"));
    refused(&compose(&scene, folder.path(), &[]), &["sea.png", "--out"]);
    assert_eq!(fs::read(folder.path().join("sea.png")).expect("the picture"), before);
}

#[test]
fn wrong_arguments_are_usage_errors() {
    for arguments in [
        vec!["compose"],
        vec!["compose", "scene.toml", "--method", "magic"],
        vec!["compose", "scene.toml", "--example"],
        vec!["study", "--participants", "0"],
        vec!["study", "score"],
    ] {
        expect_code(&bowwave(arguments), 2);
    }
    refused(&bowwave(["compose", "not-there.toml"]), &["not-there.toml", "--example"]);
}

/// A study over two small seas of the user's own.
fn small_study(folder: &Path) -> PathBuf {
    let mut arguments = vec!["study".to_owned()];
    for (name, shade) in [("harbour", 0), ("bay", 40)] {
        let mut sea = seascape(320, 240);
        sea.pixels_mut().for_each(|p| p.0[2] = p.0[2].saturating_add(shade));
        sea.save(folder.join(format!("{name}.png"))).expect("a picture");
        let text = format!(
            "picture = \"{name}.png\"\n[camera]\neye_height_m = 4\nhfov_deg = 50\npitch_deg = 0\n[sea]\nbeaufort = 1\n"
        );
        arguments.extend(["--background".to_owned(), write(folder, &format!("{name}.toml"), &text)]);
    }
    fs::create_dir(folder.join("real")).expect("a folder");
    for i in 0..3 {
        seascape(200, 100).save(folder.join("real").join(format!("{i}.jpg"))).expect("a picture");
    }
    let out = folder.join("study");
    let text = |path: &Path| path.to_str().expect("a plain path").to_owned();
    arguments.extend(["--real".to_owned(), text(&folder.join("real")), "--out".to_owned(), text(&out)]);
    arguments.extend(["--participants", "2", "--methods", "full,mirror"].map(str::to_owned));
    expect_code(&bowwave(&arguments), 0);
    // A second one would make the first one's answers worthless.
    refused(&bowwave(&arguments), &["--force"]);
    out
}

#[test]
fn a_study_is_made_and_scored() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = small_study(folder.path());
    let key = fs::read_to_string(out.join("key.csv")).expect("the key");
    let rows: Vec<Vec<&str>> = key.lines().skip(1).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows.len(), 67);
    assert_eq!(rows.iter().filter(|r| r[1] == "real").count(), 3);
    for (column, level, count) in
        [(2, "full", 32), (2, "mirror", 32), (3, "on", 32), (4, "bay", 32), (5, "textured", 32)]
    {
        assert_eq!(rows.iter().filter(|r| r[column] == level).count(), count, "{level}");
    }
    let page = fs::read_to_string(out.join("study.html")).expect("the page");
    assert_eq!(page.matches("data:image/png;base64,").count(), 67);
    // No two generated pictures are the same: each factor can be seen.
    let mut pictures: Vec<Vec<u8>> = rows
        .iter()
        .filter(|r| r[1] == "generated")
        .map(|r| fs::read(out.join("pictures").join(format!("{}.png", r[0]))).expect("a picture"))
        .collect();
    let all = pictures.len();
    pictures.sort_unstable();
    pictures.dedup();
    assert!(pictures.len() == all, "{} of {all} pictures differ", pictures.len());

    // Somebody who takes every picture by "full" for real, and all real ones.
    let mut answers = String::from("participant,position,picture,answer,time_ms\n");
    for (i, row) in rows.iter().enumerate() {
        let answer = if row[1] == "real" || row[2] == "full" { "real" } else { "generated" };
        answers += &format!("1,{},{},{answer},900\n", i + 1, row[0]);
    }
    let answers = write(folder.path(), "answers-1.csv", &answers);
    let key = out.join("key.csv");
    let output =
        bowwave(["study", "score", &answers, "--json", "--key", key.to_str().expect("a plain path")]);
    expect_code(&output, 0);
    let lines: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let find = |level: &str| {
        lines
            .as_array()
            .and_then(|l| l.iter().find(|l| l["level"] == level))
            .unwrap_or_else(|| panic!("{lines}"))
    };
    assert_eq!((find("full")["rate"].as_f64(), find("mirror")["rate"].as_f64()), (Some(1.0), Some(0.0)));
    assert_eq!(find("generated")["rate"].as_f64(), Some(0.5));
    // z(1 - 1/6) - z(1/2).
    assert!((find("generated")["d_prime"].as_f64().expect("d'") - 0.967_42).abs() < 1e-4, "{lines}");
    let half = write(folder.path(), "half.csv", "participant,picture,answer\n2,p001,real\n");
    let output = bowwave(["study", "score", &half, "--key", key.to_str().expect("a plain path")]);
    expect_code(&output, 3);
    let wrong = write(folder.path(), "wrong.csv", "participant,picture,answer\n2,p001,real\n2,p400,real\n");
    let output = bowwave(["study", "score", &wrong, "--key", key.to_str().expect("a plain path")]);
    refused(&output, &["wrong.csv:3", "p400"]);
}
