use bowwave_core::{estimate::clock::ClockMap, event::ImuSample, time::Time};
use proptest::prelude::*;

use super::{
    ImuCounters, ImuDecoder, ImuFormat,
    formats::PacketReader,
    streams::{FormatTolerance, encode, truth},
};

/// Decodes what a unit sends, each packet (or group) at the time of the truth, in pieces of `piece` bytes.
fn decode(
    decoder: &mut ImuDecoder,
    format: ImuFormat,
    numbers: std::ops::Range<i64>,
    piece: usize,
) -> Vec<ImuSample> {
    let mut samples = Vec::new();
    for n in numbers {
        let arrival = truth(format, n).arrival;
        for bytes in encode(format, n).chunks(piece) {
            samples.extend(decoder.samples(bytes, arrival));
        }
    }
    samples
}

#[test]
fn every_format_tells_the_same_motion() {
    for format in ImuFormat::ALL {
        let mut decoder = ImuDecoder::fixed(format);
        let samples = decode(&mut decoder, format, 0..2_000, 1 << 12);
        let FormatTolerance { rate, accel, attitude, time_ns } = format.tolerance();
        let mut compared = 0;
        // A first sample may lack what comes from two, a learned clock settles.
        for sample in samples.iter().filter(|s| s.device_time_ns > 2_000_000_000) {
            let n = sample.arrival.ns_since(truth(format, 0).arrival) / format.simulated_period_ns();
            let expected = truth(format, n);
            assert!(
                (sample.device_time_ns - expected.device_time_ns).abs() <= time_ns,
                "{format}: {sample:?}"
            );
            assert!(
                sample.rate.abs_diff_eq(expected.rate, rate),
                "{format}: {} {}",
                sample.rate,
                expected.rate
            );
            assert!(
                sample.accel.abs_diff_eq(expected.accel, accel),
                "{format}: {} {}",
                sample.accel,
                expected.accel
            );
            let got = sample.world_from_imu.expect("all of them send one");
            let angle = got.angle_between(expected.world_from_imu.expect("given"));
            assert!(angle < attitude, "{format}: {angle} rad");
            compared += 1;
        }
        let most = 2_000 - 2_000_000_000 / format.simulated_period_ns() - 2;
        assert!(compared >= most, "{format}: {compared} of {most}");
        let counters = decoder.counters();
        assert_eq!((counters.bad_crc, counters.skipped_bytes, counters.unusable), (0, 0, 0), "{format}");
        assert_eq!(counters.packets, 2_000 * format.simulated_packets(), "{format}");
    }
}

#[test]
fn every_place_to_split_a_stream_is_fine() {
    for format in ImuFormat::ALL {
        let whole = decode(&mut ImuDecoder::new(), format, 0..40, 1 << 12);
        assert!(whole.len() >= 38, "{format}: {}", whole.len());
        for piece in 1..encode(format, 0).len() {
            assert_eq!(
                decode(&mut ImuDecoder::new(), format, 0..40, piece),
                whole,
                "{format}, pieces of {piece}"
            );
        }
    }
}

/// Lines of a receiver that shares the line, between packets.
const TEXT: &[u8] = b"\r\n$GPRMC,092725.00,A,4717.11437,N,00833.91522,E,0.004,77.52,091202,,,A*5E\r\n";

#[test]
fn each_format_is_recognised_and_loses_no_sample() {
    for format in ImuFormat::ALL {
        let known = decode(&mut ImuDecoder::fixed(format), format, 0..40, 1 << 12);
        for text in [false, true] {
            let mut decoder = ImuDecoder::new();
            let mut samples = Vec::new();
            let mut recognised = None;
            for n in 0..40 {
                let arrival = truth(format, n).arrival;
                if text && n % 8 == 0 {
                    assert_eq!(decoder.samples(TEXT, arrival).next(), None, "text is no sample");
                }
                samples.extend(decoder.samples(&encode(format, n), arrival));
                if decoder.format().is_some() && recognised.is_none() {
                    recognised = Some((n + 1) as u64 * format.simulated_packets());
                }
            }
            assert_eq!(decoder.format(), Some(format), "text: {text}");
            // Whole groups are pushed, and one packet behind noise may wait for what follows it.
            let at_most = (format.proof_packets() as u64 + 1).next_multiple_of(format.simulated_packets());
            assert!(recognised.expect("recognised") <= at_most, "{format}: {recognised:?}, text: {text}");
            assert_eq!(samples, known, "{format}, text: {text}");
        }
    }
}

/// SplitMix64 (Steele, Lea, Flood 2014).
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[test]
fn noise_and_other_devices_are_no_unit() {
    let mut state = 7;
    let mut decoder = ImuDecoder::new();
    let noise: Vec<u8> = (0..4_000_000 / 8).flat_map(|_| random(&mut state).to_le_bytes()).collect();
    // Preambles of all formats are common in it.
    let words: [&[u8]; 8] = [
        &[0xfa, 1],
        &[0xfa, 0xff, 0x36],
        b"$VNYMR,",
        &[0x75, 0x65, 0x80],
        &[0xff, 0x5a, 3, 0],
        &[0xaa, 0xaa],
        &[0x55, 0x51],
        &[0x55, 0x52],
    ];
    let laced: Vec<u8> =
        noise.chunks(11).take(100_000).flat_map(|c| [words[usize::from(c[0] % 8)], c].concat()).collect();
    for bytes in [&noise, &laced] {
        for piece in bytes.chunks(512) {
            assert_eq!(decoder.samples(piece, Time::MIN).next(), None, "made of noise");
            assert_eq!(decoder.format(), None);
        }
    }
    for n in 0..20_000 {
        // A receiver's text and its binary protocol.
        assert_eq!(decoder.samples(TEXT, Time::from_ns(n)).next(), None, "made of text");
        decoder
            .samples(&[0xb5, 0x62, 0x01, 0x07, 0x5c, 0x00, n as u8, 0xff, 0xaa], Time::from_ns(n))
            .for_each(drop);
    }
    assert_eq!(decoder.format(), None);
    let counters = decoder.counters();
    assert_eq!((counters.packets, counters.samples), (0, 0));
    assert!(counters.skipped_bytes > 6_000_000, "{counters:?}");
}

/// Each decoder alone on the others' streams: chance packets there may be, but never so many close together.
#[test]
fn no_format_is_taken_for_another() {
    for format in ImuFormat::ALL {
        let mut candidates: Vec<(ImuFormat, ImuDecoder)> = Vec::new();
        for other in ImuFormat::ALL.into_iter().filter(|o| *o != format) {
            candidates.push((other, ImuDecoder::fixed(other)));
        }
        for n in 0..5_000 {
            let bytes = encode(format, n);
            let mut decoder = ImuDecoder::new();
            decoder.samples(&bytes, Time::from_ns(n)).for_each(drop);
            assert!(decoder.format().is_none_or(|found| found == format));
            for (other, candidate) in &mut candidates {
                assert_eq!(candidate.samples(&bytes, Time::from_ns(n)).next(), None, "{other} of {format}");
            }
        }
        for (other, candidate) in &candidates {
            assert!(candidate.counters().packets <= 2, "{other} in {format}: {:?}", candidate.counters());
        }
    }
}

#[test]
fn another_unit_on_the_line_is_recognised() {
    let mut decoder = ImuDecoder::new();
    let mut sum = 0;
    for format in [ImuFormat::VectorNav, ImuFormat::Witmotion, ImuFormat::Xsens, ImuFormat::VectorNav] {
        let samples = decode(&mut decoder, format, 0..400, 64);
        assert_eq!(decoder.format(), Some(format));
        assert!(samples.len() > 250, "{format}: {}", samples.len());
        sum += samples.len() as u64;
        assert_eq!(decoder.counters().samples, sum, "what came before stays counted");
    }
    decoder.restart();
    assert_eq!((decoder.format(), decoder.counters().samples), (None, sum));
    let mut fixed = ImuDecoder::fixed(ImuFormat::Xsens);
    assert!(decode(&mut fixed, ImuFormat::VectorNav, 0..1_000, 64).is_empty());
    assert_eq!(fixed.format(), Some(ImuFormat::Xsens), "what is fixed stays");
}

/// A packet on its own, long before the unit's, is not handed on late, and is not counted as a sample.
#[test]
fn what_came_before_the_proof_is_left_out() {
    // SBG's rate and attitude are two packets, and with that a proof.
    for format in ImuFormat::ALL.into_iter().filter(|f| (f.simulated_packets() as usize) < f.proof_packets())
    {
        let mut decoder = ImuDecoder::new();
        let mut samples = Vec::new();
        samples.extend(decoder.samples(&encode(format, 0), Time::from_ns(0)));
        samples.extend(decoder.samples(&[b' '; 3000], Time::from_ns(1)));
        assert_eq!(decoder.format(), None, "{format}");
        samples.extend(decode(&mut decoder, format, 100..130, 1 << 12));
        assert!(samples.iter().all(|s| s.arrival >= truth(format, 100).arrival), "{format}");
        let counters = decoder.counters();
        assert_eq!(counters.samples, samples.len() as u64, "{format}");
        assert!(consistent(&counters), "{format}: {counters:?}");
    }
}

/// Fields of a unit, and the remedy for the rest, in words.
#[test]
fn what_a_unit_sends_and_lacks_is_told() {
    let told = |format| {
        let mut decoder = ImuDecoder::new();
        decode(&mut decoder, format, 0..10, 64);
        decoder.fields().to_string()
    };
    assert_eq!(told(ImuFormat::Sbg), "sends device time, angular rate, acceleration, attitude");
    assert_eq!(
        told(ImuFormat::Bno08x),
        "sends packet counter, acceleration, attitude; lacks device time (made from its counter), angular rate (made from \
         its attitudes)"
    );
    assert_eq!(
        told(ImuFormat::Witmotion),
        "sends angular rate, acceleration, attitude; lacks device time (made from arrivals)"
    );
    assert_eq!(
        ImuDecoder::new().fields().to_string(),
        "sends nothing that the trainer uses; lacks device time (made from arrivals), angular rate, acceleration, attitude \
         (integrated from its rate)"
    );
}

/// Units without a clock, read behind an adapter that hands bytes on every 16 ms: the host's map of their time.
#[test]
fn made_up_clocks_are_even() {
    for format in [ImuFormat::Bno08x, ImuFormat::Witmotion, ImuFormat::VectorNavAscii] {
        let mut decoder = ImuDecoder::fixed(format);
        let mut map = ClockMap::new();
        let (mut worst, mut mean, mut count) = (0f64, 0.0, 0.0);
        let mut errors = Vec::new();
        for n in 0..12_000 {
            let due = truth(format, n).arrival.ns();
            let arrival = Time::from_ns((due + 15_999_999) / 16_000_000 * 16_000_000);
            for s in decoder.samples(&encode(format, n), arrival) {
                let error_ms = (map.observe(s.device_time_ns, arrival).ns() - due) as f64 * 1e-6;
                if n > 4_000 {
                    errors.push(error_ms);
                    mean += error_ms;
                    count += 1.0;
                }
            }
        }
        mean /= count;
        for error in errors {
            worst = worst.max((error - mean).abs());
        }
        eprintln!("{format}: stamps within {worst:.2} ms of their mean, arrivals within 8");
        assert!(worst < 3.0 && map.restarts() == 0, "{format}: {worst} ms");
    }
}

/// Bytes with many beginnings of packets of all formats.
fn noise() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![
        6 => any::<u8>(),
        1 => prop::sample::select(vec![0xfa, 0xff, 0x36, b'$', b'V', b'N', 0x75, 0x65, 0x80, 0x5a, 0xaa, 0x55, 0x51, 0x52]),
    ];
    prop::collection::vec(byte, 0..60)
}

fn consistent(c: &ImuCounters) -> bool {
    c.packets == c.samples + c.not_finite + c.unusable + c.other && c.bad_crc <= c.skipped_bytes
}

proptest! {
    #[test]
    fn any_bytes_are_survived(bytes in prop::collection::vec(noise(), 0..60), piece in 1usize..2000, fixed in 0usize..=ImuFormat::ALL.len()) {
        let bytes = bytes.concat();
        let mut decoder = ImuDecoder::with(ImuFormat::ALL.get(fixed).copied());
        let mut samples = 0;
        for piece in bytes.chunks(piece) {
            for s in decoder.samples(piece, Time::from_ns(5)) {
                assert!(s.is_finite());
                samples += 1;
            }
        }
        let counters = decoder.counters();
        prop_assert!(consistent(&counters), "{counters:?}");
        prop_assert_eq!(counters.samples, samples);
        prop_assert!(counters.skipped_bytes <= bytes.len() as u64);
    }

    /// Whatever lies between them, each packet is found in order and once, unless a chance packet with a right check sum lay
    /// over it.
    #[test]
    fn noise_between_packets_loses_none(gaps in prop::collection::vec(noise(), 1..20), piece in 1usize..400, at in 0usize..ImuFormat::ALL.len()) {
        let format = ImuFormat::ALL[at];
        let mut bytes = Vec::new();
        let mut sent = Vec::new();
        for (n, gap) in (0..).zip(&gaps) {
            bytes.extend(gap);
            let packet = encode(format, n);
            sent.push(packet.len());
            bytes.extend(packet);
        }
        // The line goes on with what begins no packet.
        bytes.extend([0x20; 4200]);
        let mut unit = PacketReader::new(format);
        let mut found = 0;
        for piece in bytes.chunks(piece) {
            unit.insert(piece);
            while unit.next_packet().is_some() {
                found += 1;
            }
        }
        let expected = sent.len() as u64 * format.simulated_packets();
        let counters = unit.counters();
        prop_assert_eq!(found, counters.packets);
        let skipped: usize = gaps.iter().map(Vec::len).sum::<usize>() + 4200;
        if counters.skipped_bytes == skipped as u64 {
            prop_assert_eq!(counters.packets, expected);
        } else {
            // A chance packet, once in a few thousand streams where sums have sixteen bits: how many real ones it lay over is bounded by
            // its length.
            let chances = format.intact_places(&bytes) as u64 - expected;
            prop_assume!(chances == 0 || format.is_weak());
            prop_assert!(chances > 0 && counters.packets + 3 >= expected, "{format}: {counters:?}, {expected} were sent");
        }
    }
}
