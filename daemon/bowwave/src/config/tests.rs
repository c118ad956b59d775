use bowwave_core::{act::Act, event::MarkKind};
use bowwave_devices::{
    camera::{Coding, Exposure, Rate, WhiteBalance},
    imu::ImuFormat,
    serial::Baud,
    trigger::{Bias, Press, PressKind},
};

use super::*;

fn refused(text: &str) -> String {
    parse(text, "x.toml", Path::new("/etc")).unwrap_err().to_string()
}

#[test]
fn the_installed_file_is_valid() {
    let text = include_str!("../../../../systemd/bowwave.toml");
    let config = parse(text, "systemd/bowwave.toml", Path::new(".")).unwrap();
    assert_eq!(config.output, ScreenOutput::Lcd);
}

/// The installed file shows keys behind a "# ": all of them are taken at once.
#[test]
fn every_key_that_the_installed_file_shows_is_valid() {
    let is_key = |line: &str| {
        let name = line.split(" = ").next().unwrap_or_default().trim_matches(['[', ']']);
        (line.contains(" = ") || line.starts_with('['))
            && name.chars().all(|c| c.is_ascii_lowercase() || c == '_')
    };
    let mut shown = 0;
    let mut whole = String::new();
    for line in include_str!("../../../../systemd/bowwave.toml").lines() {
        let key = line.strip_prefix("# ").filter(|line| is_key(line));
        shown += usize::from(key.is_some());
        whole += key.unwrap_or(line);
        whole.push('\n');
    }
    assert!(shown > 40, "only {shown} keys");
    let config = parse(&whole, "systemd/bowwave.toml", Path::new(".")).unwrap();
    assert_eq!(config.warnings, [""; 0]);
    assert!(
        config.gpio.trigger.is_some() && config.gpio.lamps.is_some() && config.heading.presses.len() == 11
    );
    // An open wire of either contact that it shows reads as not inert.
    let interlock = config.gpio.interlock.expect("an interlock");
    assert!(interlock.second.is_some());
    assert_eq!(interlock.check().map_err(|e| e.to_string()), Ok(()));
}

#[test]
fn every_key_is_read() {
    let text = r#"
        [screen]
        output = "window"
        size = "800x480"
        card = "/dev/dri/card1"
        connector = "HDMI-A-1"
        refresh_hz = 60.0
        legacy = true
        [camera]
        device = "/dev/bowwave/camera"
        serial = "A1"
        modes = ["YUYV 1280x720@30", "mjpg 640x480@30000/1001"]
        exposure_us = 5000
        white_balance_k = "auto"
        focus = 3
        gain = 4
        buffers = 5
        readout_us = 9000
        [imu]
        device = "/dev/bowwave/imu"
        baud = [115200, 921600]
        format = "xsens"
        orientation = "fused"
        low_latency = false
        packet_jitter_ms_max = 12.5
        [ship]
        device = "/dev/serial/by-id/usb-Moxa_*-port0"
        baud = [4800, 38400]
        latency_ms = 70
        sigma_deg = 0.4
        [rezero]
        input = { chip = "/dev/gpiochip0", line = "rezero", active_low = true }
        from_bow_deg = -90
        from_north_deg = 318.0
        sigma_deg = 0.3
        [buttons]
        report = { chip = "/dev/gpiochip0", line = "report", active_low = true, bias = "pull-up" }
        [landmarks]
        at = [{ bearing_deg = 41.3, sigma_deg = 0.2 }, { bearing_deg = 127 }]
        input = { chip = "/dev/gpiochip0", line = 9 }
        [heading]
        growth_deg_per_h = 36
        sky_drift_deg_per_h = 1.8
        display_sigma_above_deg = 0.4
        [trigger]
        chip = "/dev/gpiochip0"
        line = 17
        active_low = true
        debounce_ms = 12
        [interlock]
        chip = "/dev/gpiochip0"
        line = "inert"
        bias = "external-pull-down"
        second = { chip = "/dev/gpiochip0", line = 9, active_low = true, bias = "pull-up" }
        discrepancy_ms = 300
        [power_fail]
        chip = "gpio-sim"
        line = 2
        [lamps]
        chip = "/dev/gpiochip1"
        ready = "ready"
        fault = 5
        [gpu]
        device = "llvm"
        validation = true
        gpu_timeout_ms = 900
        [files]
        scenario = "a.toml"
        calibration = "/b.toml"
        record = true
        data = "/var/lib/bowwave"
        [health]
        thermal = "/sys/class/thermal/thermal_zone0/temp"
        temperature_c_max = 85.0
    "#;
    let config = parse(text, "x.toml", Path::new("/etc")).unwrap();
    assert_eq!((config.output, config.size), (ScreenOutput::Window, Some((800, 480))));
    assert_eq!(config.lcd.connector.as_deref(), Some("HDMI-A-1"));
    assert_eq!((config.lcd.mode.refresh_hz, config.lcd.legacy), (Some(60.0), true));
    let camera = &config.camera;
    let modes: Vec<_> = camera.modes.iter().map(|m| (m.coding, m.width, m.height, m.rate)).collect();
    let ntsc = Rate::new(30_000, 1001).unwrap();
    assert_eq!(modes, [(Coding::Yuyv, 1280, 720, Rate::hz(30).unwrap()), (Coding::Mjpeg, 640, 480, ntsc)]);
    assert_eq!(camera.controls.exposure, Exposure::Locked { time_us: 5000 });
    assert_eq!(camera.controls.white_balance, WhiteBalance::Auto);
    assert_eq!((camera.buffers, camera.readout_us, camera.controls.gain), (5, Some(9000), Some(4)));
    assert_eq!(config.imu.line.baud, Baud::Scan(vec![115_200, 921_600]));
    assert_eq!(config.imu.format, Some(ImuFormat::Xsens));
    assert_eq!(config.orientation, Orientation::Fused);
    let line = |chip: &str, line: &str, active_low, bias| InputLine {
        chip: chip.into(),
        line: line.into(),
        active_low,
        bias,
    };
    let heading = &config.heading;
    let ship = heading.ship.as_ref().unwrap();
    assert_eq!(ship.device.as_deref(), Some(Path::new("/dev/serial/by-id/usb-Moxa_*-port0")));
    assert_eq!(ship.baud, Baud::Scan(vec![4_800, 38_400]));
    let s = &heading.settings;
    assert_eq!((s.ship.latency_ns, s.ship.sigma), (70_000_000, 0.4f64.to_radians()));
    let stow = s.stow.unwrap();
    assert_eq!(stow.from_bow, Some((-90f64).to_radians()));
    assert_eq!((stow.from_north, stow.sigma), (Some(318f64.to_radians()), 0.3f64.to_radians()));
    let bearings: Vec<_> = s.landmarks.iter().map(|l| (l.bearing, l.sigma)).collect();
    assert_eq!(
        bearings,
        [(41.3, 0.2), (127.0, 0.3)].map(|(b, s): (f64, f64)| (b.to_radians(), s.to_radians()))
    );
    assert_eq!((s.own_growth, s.shown_above), (Some(36f64.to_radians() / 3600.0), 0.4f64.to_radians()));
    assert_eq!(s.sky_drift, 1.8f64.to_radians() / 3600.0);
    let rezero = Press {
        line: line("/dev/gpiochip0", "rezero", true, Bias::AsIs),
        kind: PressKind::Mark(MarkKind::Stow),
    };
    let landmark = Press {
        line: line("/dev/gpiochip0", "9", false, Bias::AsIs),
        kind: PressKind::Mark(MarkKind::Landmark),
    };
    let report = Press {
        line: line("/dev/gpiochip0", "report", true, Bias::PullUp),
        kind: PressKind::Act(Act::Report),
    };
    assert_eq!(heading.presses, [rezero, landmark, report]);
    let trigger = line("/dev/gpiochip0", "17", true, Bias::AsIs);
    assert_eq!(
        config.gpio.trigger,
        Some(TriggerChoice { line: trigger, debounce: Duration::from_millis(12) })
    );
    let interlock = InterlockWiring {
        contact: line("/dev/gpiochip0", "inert", false, Bias::ExternalPullDown),
        second: Some(line("/dev/gpiochip0", "9", true, Bias::PullUp)),
        discrepancy: Duration::from_millis(300),
    };
    assert_eq!(config.gpio.interlock, Some(interlock));
    assert_eq!(config.gpio.power_fail, Some(line("gpio-sim", "2", false, Bias::AsIs)));
    let lamps = config.gpio.lamps.unwrap();
    assert_eq!((lamps.ready.as_deref(), lamps.hit, lamps.fault.as_deref()), (Some("ready"), None, Some("5")));
    assert_eq!((config.gpu.device.as_deref(), config.gpu.validation), (Some("llvm"), true));
    assert_eq!(config.gpu.timeout, Some(std::time::Duration::from_millis(900)));
    assert_eq!(config.files.scenario, Some("/etc/a.toml".into()));
    assert_eq!((config.files.calibration, config.files.record), (Some("/b.toml".into()), true));
    assert_eq!(
        (config.files.data, config.health.temperature_c_max),
        (Some("/var/lib/bowwave".into()), Some(85.0))
    );
}

#[test]
fn mistakes_are_refused_where_they_are() {
    for (text, said) in [
        (
            "[imu]\norientation = \"unit\"\n",
            "x.toml:2:15: imu.orientation: \"unit\" is not allowed; give one of \"auto\", \"fused\"",
        ),
        (
            "[imu]\nformat = \"xens\"\n",
            "x.toml:2:10: imu.format: \"xens\" is not allowed; give one of \"vectornav\", \"vectornav-ascii\", \"xsens\",",
        ),
        (
            "[screen]\nsise = \"1x1\"\n",
            "x.toml:2:1: screen.sise: unknown key; known are output, size, card, connector, refresh_hz, legacy; did you mean size?",
        ),
        ("[screen]\nsize = \"1x1\"\n", "x.toml:2:8: screen.size: '1x1' is no size"),
        ("[screen]\noutput = \"tv\"\n", "x.toml:2:10: screen.output: \"tv\" is not allowed; give one of"),
        (
            "[screen]\nrefresh_hz = 0.0\n",
            "x.toml:2:14: screen.refresh_hz: 0.0 is not allowed; give a number, 1 to 1000 Hz",
        ),
        ("[gpu]\ndevice = \" \"\n", "x.toml:2:10: gpu.device: is empty"),
        ("[gpu]\nvalidation = 3\n", "x.toml:2:14: gpu.validation: 3 is not allowed; give true or false"),
        ("[gpu\n", "x.toml:1:5: "),
        ("[camera]\nmodes = [\"YUYV\"]\n", "x.toml:2:10: camera.modes: 'YUYV' is no mode"),
        (
            "[camera]\nexposure_us = \"long\"\n",
            "x.toml:2:15: camera.exposure_us: \"long\" is not allowed; give a number above 0",
        ),
        (
            "[camera]\nbuffers = 1\n",
            "x.toml:2:11: camera.buffers: 1 is not allowed; give a whole number, 3 to 32",
        ),
        (
            "[imu]\nbaud = []\n",
            "x.toml:2:8: imu.baud: [] is not allowed; give a rate such as 115200, or 1 to 16 to try",
        ),
        (
            "[trigger]\nchip = \"a\"\nline = 1\ndebounce_ms = 900\n",
            "x.toml:4:15: trigger.debounce_ms: 900 is not allowed; give a whole number, 10 to 20",
        ),
        ("[interlock]\nline = 1\n", "x.toml:1:1: interlock.chip: is missing"),
        (
            "[interlock]\nchip = \"a\"\nline = 1\ndebounce_ms = 15\n",
            "x.toml:4:15: interlock.debounce_ms: is for [trigger] alone",
        ),
        (
            "[interlock]\nchip = \"a\"\nline = 1\nsecond = { chip = \"a\", line = 2, bias = \"up\" }\n",
            "x.toml:4:41: interlock.second.bias: \"up\" is not allowed; give one of",
        ),
        (
            "[trigger]\nchip = \"a\"\nline = 1\nsecond = { chip = \"a\", line = 2 }\n",
            "x.toml:4:10: trigger.second: is for [interlock] alone",
        ),
        (
            "[interlock]\nchip = \"a\"\nline = 1\nsecond = { chip = \"a\", line = 2, discrepancy_ms = 20 }\n",
            "x.toml:4:51: interlock.second.discrepancy_ms: is for [interlock] alone",
        ),
        (
            "[interlock]\nchip = \"a\"\nline = 1\ndiscrepancy_ms = 0\n",
            "x.toml:4:18: interlock.discrepancy_ms: 0 is not allowed; give a whole number, 10 to 5000",
        ),
        (
            "[trigger]\nchip = \"a\"\nline = -1\n",
            "x.toml:3:8: trigger.line: -1 is not allowed; give the line's number",
        ),
        (
            "[trigger]\nchip = \"a\"\nline = 1\nbias = \"up\"\n",
            "x.toml:4:8: trigger.bias: \"up\" is not allowed; give one of",
        ),
        ("[ship]\nbaud = 4800\n", "x.toml:1:1: ship.device: is missing"),
        ("[ship]\ndevice = \"/dev/tty[\"\n", "x.toml:2:10: ship.device: "),
        (
            "[ship]\ndevice = \"a\"\nlatency_ms = -1\n",
            "x.toml:3:14: ship.latency_ms: -1 is not allowed; give a number, 0 to 1500 ms",
        ),
        ("[ship]\ndevice = \"a\"\nbaud = 0\n", "x.toml:3:8: ship.baud: "),
        ("[rezero]\nsigma_deg = 1\n", "x.toml:1:1: rezero.from_bow_deg: is missing; give it"),
        (
            "[landmarks]\nat = [{ bearing_deg = 400 }]\n",
            "x.toml:2:23: landmarks.at[1].bearing_deg: 400 is not allowed; give a number, -360 to 360 degrees",
        ),
        ("[heading]\ngrowth_deg_per_h = -1\n", "x.toml:2:20: heading.growth_deg_per_h: -1 is not allowed"),
        ("[health]\ntemperature_c_max = nan\n", "x.toml:2:21: health.temperature_c_max: nan is not allowed"),
    ] {
        assert!(refused(text).starts_with(said), "{}", refused(text));
    }
}

#[test]
fn former_names_of_keys_are_read_with_a_warning_that_names_the_new_one() {
    let text = "[heading]\nshown_above_deg = 0.4\n[imu]\nlate_ms = 12.5\n[gpu]\nhang_ms = 900\n[health]\nlimit_c = 85\n";
    let old = parse(text, "x.toml", Path::new("/etc")).unwrap();
    let named = [
        ("2:1: heading.shown_above_deg", "display_sigma_above_deg"),
        ("4:1: imu.late_ms", "packet_jitter_ms_max"),
        ("6:1: gpu.hang_ms", "gpu_timeout_ms"),
        ("8:1: health.limit_c", "temperature_c_max"),
    ];
    assert_eq!(old.warnings.len(), named.len(), "{:?}", old.warnings);
    let mut renamed = text.to_owned();
    for (warning, (place, new)) in old.warnings.iter().zip(named) {
        assert!(warning.starts_with(&format!("x.toml:{place}: is now called {new};")), "{warning}");
        let (_, former) = place.rsplit_once('.').unwrap();
        renamed = renamed.replace(former, new);
    }
    let new = parse(&renamed, "x.toml", Path::new("/etc")).unwrap();
    assert_eq!(new.warnings, [""; 0]);
    assert_eq!(Config { warnings: vec![], ..old }, new);
    for (place, new) in named {
        let (path, former) = place.rsplit_once('.').unwrap();
        let table = path.rsplit(' ').next().unwrap();
        let both = refused(&format!("[{table}]\n{new} = 300\n{former} = 300\n"));
        assert!(both.contains(&format!("is the former name of {new}; leave it out")), "{both}");
    }
}
