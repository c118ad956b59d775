#!/usr/bin/env python3
"""How well a small trained detector tells generated reflections from real ones: AUC by method.

    python3 -m venv target/detector && target/detector/bin/pip install -r tests/precision/detector/requirements.txt
    target/detector/bin/python tests/precision/detector/detector.py target/precision/photographs/scenes --out detector.csv

A folder of scenes: each a folder with photograph.png (real), METHOD.png of the same size for each method, and region.png, white
where the reflection is. Scenes whose names agree up to the last hyphen are one view (frames of one video): a view is either
trained on or tested on, never both. Each view in turn is tested by a detector that was trained on all others.

The detector looks at patches of 32 pixels and knows no positions: gradients at four scales and in both directions, their
kurtosis, the spread and mean of colours, and how neighbouring rows and columns hang together; a random forest of scikit-learn votes.
0.5 cannot tell, 1 always tells. The error is a bootstrap over pictures and, within them, patches.
"""

import argparse
import csv
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import roc_auc_score

PATCH = 32
STEP = 16
# Share of a patch that must lie in the region.
INSIDE = 0.9
REAL = "photograph"
BOOTSTRAPS = 400


def features(patch):
    """What of a patch (linear in codes, 0 to 1) the forest sees."""
    luma = patch @ np.array([0.299, 0.587, 0.114])
    chroma = patch - luma[..., None]
    values = [luma.std(), *chroma.mean((0, 1)), *chroma.std((0, 1))]
    level = luma
    for _ in range(4):
        for axis in (0, 1):
            step = np.diff(level, axis=axis)
            power = (step**2).mean()
            values += [np.log(power + 1e-7), ((step**4).mean() + 1e-9) / (power**2 + 1e-8)]
            centred = level - level.mean()
            shifted = np.roll(centred, 1, axis)
            values.append((centred * shifted).mean() / (centred.var() + 1e-6))
        level = level.reshape(level.shape[0] // 2, 2, -1, 2).mean((1, 3))
    return np.array(values)


def patches(picture, region):
    """Features of all patches that lie in the region."""
    found = []
    for top in range(0, picture.shape[0] - PATCH + 1, STEP):
        for left in range(0, picture.shape[1] - PATCH + 1, STEP):
            if region[top : top + PATCH, left : left + PATCH].mean() >= INSIDE:
                found.append(features(picture[top : top + PATCH, left : left + PATCH]))
    return np.array(found)


def load(folder):
    """Features by scene and picture: {scene: {picture: rows}}."""
    scenes = {}
    for scene in sorted(p for p in folder.iterdir() if (p / f"{REAL}.png").exists()):
        read = lambda name: np.asarray(Image.open(scene / f"{name}.png").convert("RGB"), float) / 255
        region = read("region")[..., 0] > 0.5
        names = [p.stem for p in scene.glob("*.png") if p.stem != "region"]
        rows = {name: patches(read(name), region) for name in names}
        if len(rows[REAL]):
            scenes[scene.name] = rows
    return scenes


def view(scene):
    """Frames of one video are one view; stills, whose folders end in example_NN, one each."""
    return scene if "example" in scene else scene.rsplit("-", 1)[0]


def votes(scenes, method, seed):
    """For each scene the votes for "generated" of a detector that knows no scene of its view: (real, generated)."""
    result = {}
    for tested in sorted({view(s) for s in scenes}):
        rows, labels, weights = [], [], []
        for scene, of in scenes.items():
            if view(scene) != tested:
                for label, name in enumerate((REAL, method)):
                    rows.append(of[name])
                    labels += [label] * len(of[name])
                    # Each view counts the same, however large its pictures are.
                    frames = sum(view(s) == view(scene) for s in scenes)
                    weights += [1 / len(of[name]) / frames] * len(of[name])
        forest = RandomForestClassifier(n_estimators=300, min_samples_leaf=3, random_state=seed, n_jobs=1)
        forest.fit(np.concatenate(rows), labels, sample_weight=weights)
        for scene, of in scenes.items():
            if view(scene) == tested:
                result[scene] = tuple(forest.predict_proba(of[name])[:, 1] for name in (REAL, method))
    return result


def auc(pairs):
    """Mean over scenes: votes of different forests are not compared with each other."""
    labelled = lambda real, generated: ([0] * len(real) + [1] * len(generated), np.concatenate([real, generated]))
    return float(np.mean([roc_auc_score(*labelled(*pair)) for pair in pairs]))


def measure(scenes, method, seed=1):
    """AUC and its bootstrap error."""
    pairs = list(votes(scenes, method, seed).values())
    random = np.random.default_rng(seed)
    drawn = []
    for _ in range(BOOTSTRAPS):
        chosen = [pairs[i] for i in random.integers(0, len(pairs), len(pairs))]
        again = lambda v: v[random.integers(0, len(v), len(v))]
        drawn.append(auc([(again(real), again(generated)) for real, generated in chosen]))
    return auc(pairs), float(np.std(drawn))


def self_test():
    """The detector finds nothing where nothing is, and what is plain."""
    random = np.random.default_rng(7)
    noise = lambda: random.normal(0.5, 0.1, (160, 160, 3)).clip(0, 1)
    smooth = lambda p: (p + np.roll(p, 1, 0) + np.roll(p, 1, 1)) / 3
    region = np.ones((160, 160))
    scenes = {
        f"v{i}-0": {REAL: patches(noise(), region), "same": patches(noise(), region), "smooth": patches(smooth(noise()), region)}
        for i in range(4)
    }
    same, plain = measure(scenes, "same")[0], measure(scenes, "smooth")[0]
    assert abs(same - 0.5) < 0.12, same
    assert plain > 0.99, plain
    print(f"self-test: nothing to find {same:.2f}, plain {plain:.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path, nargs="?", help="folder of scenes")
    parser.add_argument("--out", type=Path, help="CSV to write")
    parser.add_argument("--self-test", action="store_true", help="check the detector itself")
    arguments = parser.parse_args()
    if arguments.self_test:
        self_test()
    if arguments.scenes is None:
        return 0 if arguments.self_test else parser.error("name a folder of scenes")
    if not arguments.scenes.is_dir():
        print(f"skipped: no folder {arguments.scenes}; the photograph test writes it")
        return 0
    scenes = load(arguments.scenes)
    if len({view(s) for s in scenes}) < 2:
        print(f"detector: {arguments.scenes} has fewer than two views with patches of {PATCH} pixels", file=sys.stderr)
        return 1
    methods = sorted(set.intersection(*(set(of) for of in scenes.values())) - {REAL})
    rows = [(method, *measure(scenes, method)) for method in methods]
    count = sum(len(of[REAL]) for of in scenes.values())
    print(f"{len(scenes)} scenes of {len({view(s) for s in scenes})} views, {count} real patches")
    for method, value, error in rows:
        print(f"{method:<20} AUC {value:.3f} +- {error:.3f}")
    if arguments.out:
        with arguments.out.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["method", "auc", "auc_error"])
            writer.writerows((m, f"{v:.4f}", f"{e:.4f}") for m, v, e in rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
