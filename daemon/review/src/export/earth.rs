//! Places on the Earth of what a run knows by metres from the gun (WGS 84).

use bowwave_core::ephemeris::Place;

/// Half the Earth's diameter at the equator, metres, and its flattening.
const EQUATOR_M: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// Longitude and latitude, degrees, of what lies so many metres east and north of `gun` in the plane that touches the sea there.
pub fn longitude_latitude(gun: Place, [east, north]: [f64; 2]) -> [f64; 2] {
    let squared = FLATTENING * (2.0 - FLATTENING);
    let (sin_lat, cos_lat) = gun.latitude_deg().to_radians().sin_cos();
    let (sin_lon, cos_lon) = gun.longitude_deg().to_radians().sin_cos();
    let prime = EQUATOR_M / (1.0 - squared * sin_lat * sin_lat).sqrt();
    // Axes through the Earth's middle: towards 0 N 0 E, 0 N 90 E and the pole.
    let x = prime * cos_lat * cos_lon - east * sin_lon - north * sin_lat * cos_lon;
    let y = prime * cos_lat * sin_lon + east * cos_lon - north * sin_lat * sin_lon;
    let z = prime * (1.0 - squared) * sin_lat + north * cos_lat;
    // Bowring 1976: exact to a hair's breadth near the sea.
    let flat = x.hypot(y);
    let (sin, cos) = z.atan2(flat * (1.0 - FLATTENING)).sin_cos();
    let polar = EQUATOR_M * (1.0 - FLATTENING);
    let second = squared / (1.0 - squared);
    let latitude = (z + second * polar * sin.powi(3)).atan2(flat - squared * EQUATOR_M * cos.powi(3));
    [y.atan2(x).to_degrees(), latitude.to_degrees()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minute_of_latitude_is_a_sea_mile_and_far_places_follow_the_earths_shape() {
        let at = |latitude, longitude, offset| {
            longitude_latitude(Place::new(latitude, longitude).expect("a place"), offset)
        };
        for latitude in [-89.0, -33.9, 0.0, 54.1, 89.0] {
            let [lon, lat] = at(latitude, 7.9, [0.0; 2]);
            assert!((lon - 7.9).abs() < 1e-9 && (lat - latitude).abs() < 1e-9, "{lon} {lat}");
        }
        // Lengths of a degree that tables have (NGA: 111.132 km at 45 N; 78.847 km of longitude there).
        let [lon, lat] = at(45.0, 0.0, [788.47, 1111.32]);
        assert!((lon - 0.01).abs() < 3e-6 && (lat - 45.01).abs() < 2e-6, "{lon} {lat}");
        // East of the gun, the great circle bends to the equator: by x^2 tan(latitude) / 2 R.
        let [_, lat] = at(60.0, 0.0, [10_000.0, 0.0]);
        assert!(((60.0 - lat) * 111_412.0 - 13.55).abs() < 0.1, "{lat}");
        // Beyond 180 E it is west.
        let [lon, _] = at(0.0, 179.999, [1000.0, 0.0]);
        assert!((lon + 179.992).abs() < 1e-4, "{lon}");
    }
}
