#!/usr/bin/env python3
"""Writes moon_libastro_points.csv: where the moon is seen, by libastro (XEphem) through the package ephem 4 (MIT).

    pip install ephem==4.2
    python3 tests/precision/data/moon_libastro_points.py > tests/precision/data/moon_libastro_points.csv
"""

import math
import random

import ephem

POINTS = 400

random.seed(24)
print(f"# libastro by ephem {ephem.__version__}: topocentric, seen from sea level, refraction for 1010 mbar and 10 C")
print("utc,latitude_deg,longitude_deg,azimuth_deg,elevation_deg,lit")
written = 0
while written < POINTS:
    observer = ephem.Observer()
    latitude = random.choice([random.uniform(-70, 70), random.uniform(-30, 30), random.choice([-1, 1]) * random.uniform(80, 89.9)])
    longitude = random.uniform(-180, 180)
    observer.lat, observer.lon = str(latitude), str(longitude)
    observer.elevation, observer.pressure, observer.temp = 0, 1010, 10
    second = random.randrange(0, 86400)
    date = ephem.Date((random.randrange(1990, 2050), random.randrange(1, 13), random.randrange(1, 29), 0, 0, 0))
    observer.date = ephem.Date(date + second * ephem.second)
    moon = ephem.Moon(observer)
    elevation = math.degrees(moon.alt)
    if elevation < 0.5:
        continue
    year, month, day, hour, minute, whole = observer.date.tuple()
    # Its own date has a ten-thousandth of a second more or less.
    stamp = f"{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{whole:06.3f}"
    print(
        f"{stamp},{latitude:.9f},{longitude:.9f},{math.degrees(moon.az):.6f},{elevation:.6f},{moon.moon_phase:.6f}"
    )
    written += 1
