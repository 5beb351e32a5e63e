#!/usr/bin/env python3
"""The values of tests/accuracy/metric_test.cpp, by other programs.

SSIM is scikit-image's `structural_similarity`. FLIP follows the formulas and constants of its authors' Python program
(NVlabs/flip, python/flip_api.py of 2021) with NumPy, SciPy's two-dimensional correlation in place of OpenCV's, and double
precision. Needs python3-skimage (0.19.3 was used); no part of the build runs it.
"""
import numpy as np
from scipy.ndimage import correlate
from skimage.metrics import structural_similarity

WIDTH, HEIGHT = 48, 40
PIXELS_PER_DEGREE = 3840 * np.pi / 180
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def noise(seed):
    values = np.zeros(WIDTH * HEIGHT * 3)
    for i in range(len(values)):
        seed = (seed * 6364136223846793005 + 1442695040888963407) % 2**64
        values[i] = (seed >> 40) / float(1 << 24)
    return values.reshape(HEIGHT, WIDTH, 3)


def base():
    x, y, c = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT), np.arange(3), indexing="xy")
    waves = 0.5 + 0.35 * np.sin(0.31 * x + 0.9 * c) * np.cos(0.23 * y - 0.5 * c)
    return np.where((x - 30) ** 2 + (y - 12) ** 2 < 64, 0.9 - 0.3 * c, waves)


WHITE = np.array([0.950428545, 1.0, 1.088900371])
TO_XYZ = np.array([[10135552, 8788810, 4435075], [2613072 * 2, 8788810 * 2, 887015 * 2],
                   [1425312 / 3, 8788810 / 3, 70074185 / 3]]) / 24577794
TO_RGB = np.array([[3.241003275, -1.537398934, -0.498615861], [-0.969224334, 1.875930071, 0.041554224],
                   [0.055639423, -0.204011202, 1.057148933]])


def encode(v):
    return np.where(v > 0.0031308, 1.055 * np.power(np.maximum(v, 1e-30), 1 / 2.4) - 0.055, 12.92 * v)


def decode(v):
    return np.where(v > 0.04045, np.power((v + 0.055) / 1.055, 2.4), v / 12.92)


def opponent(t):
    return np.stack([116 * t[..., 1] - 16, 500 * (t[..., 0] - t[..., 1]), 200 * (t[..., 1] - t[..., 2])], -1)


def ycxcz(linear):
    return opponent(linear @ TO_XYZ.T / WHITE)


def linear_of_ycxcz(c):
    y = (c[..., 0] + 16) / 116
    return (np.stack([y + c[..., 1] / 500, y, y - c[..., 2] / 200], -1) * WHITE) @ TO_RGB.T


def hunt_lab(linear):
    t, d = linear @ TO_XYZ.T / WHITE, 6 / 29
    lab = opponent(np.where(t > d**3, np.cbrt(t), t / (3 * d * d) + 4 / 29))
    return lab * np.stack([np.ones_like(lab[..., 0]), 0.01 * lab[..., 0], 0.01 * lab[..., 0]], -1)


def hyab(a, b):
    return abs(a[..., 0] - b[..., 0]) + np.hypot(a[..., 1] - b[..., 1], a[..., 2] - b[..., 2])


def contrast_filter(a1, b1, a2, b2):
    r = int(np.ceil(3 * np.sqrt(0.04 / (2 * np.pi**2)) * PIXELS_PER_DEGREE))
    x, y = np.meshgrid(range(-r, r + 1), range(-r, r + 1))
    z = (x**2 + y**2) / PIXELS_PER_DEGREE**2
    s = sum(a * np.sqrt(np.pi / b) * np.exp(-np.pi**2 * z / b) for a, b in ((a1, b1), (a2, b2)))
    return s / s.sum()


def feature(y, point):
    sd = 0.5 * 0.082 * PIXELS_PER_DEGREE
    r = int(np.ceil(3 * sd))
    u, v = np.meshgrid(range(-r, r + 1), range(-r, r + 1))
    g = np.exp(-(u**2 + v**2) / (2 * sd * sd))
    w = (u**2 / sd**2 - 1) * g if point else -u * g
    w = np.where(w < 0, -w / w[w < 0].sum(), w / w[w > 0].sum())
    return np.hypot(correlate(y, w, mode="nearest"), correlate(y, w.T, mode="nearest"))


def ldr_flip(reference, test):
    """Of sRGB codes in [0, 1]."""
    filters = [contrast_filter(1, 0.0047, 0, 1e-5), contrast_filter(1, 0.0053, 0, 1e-5), contrast_filter(34.1, 0.04, 13.5, 0.025)]
    a, b = ycxcz(decode(reference)), ycxcz(decode(test))

    def perceived(c):
        smooth = np.stack([correlate(c[..., i], filters[i], mode="nearest") for i in range(3)], -1)
        return hunt_lab(np.clip(linear_of_ycxcz(smooth), 0, 1))

    colour = hyab(perceived(a), perceived(b)) ** 0.7
    largest = hyab(hunt_lab(np.array([0.0, 1, 0])), hunt_lab(np.array([0.0, 0, 1]))) ** 0.7
    knee = 0.4 * largest
    colour = np.where(colour < knee, 0.95 / knee * colour, 0.95 + (colour - knee) / (largest - knee) * 0.05)
    ya, yb = (a[..., 0] + 16) / 116, (b[..., 0] + 16) / 116
    features = np.maximum(abs(feature(ya, False) - feature(yb, False)), abs(feature(ya, True) - feature(yb, True)))
    return colour ** (1 - np.sqrt(features / np.sqrt(2)))


def hdr_flip(reference, test):
    k = [0.36 * 2.51, 0.018, 0, 0.36 * 2.43, 0.6 * 0.59, 0.14]
    p, q = (k[1] - k[4] * 0.85) / (k[0] - k[3] * 0.85), (k[2] - k[5] * 0.85) / (k[0] - k[3] * 0.85)
    shown = -0.5 * p + np.sqrt((0.5 * p) ** 2 - q)
    y = reference @ LUMINANCE
    start, stop = np.log2(shown / y.max()), np.log2(shown / np.percentile(y, 50))
    count = int(max(2, np.ceil(stop - start)))

    def screen(v, exposure):
        x = 2.0**exposure * np.maximum(v, 0)
        return encode(np.clip((k[0] * x * x + k[1] * x) / (k[3] * x * x + k[4] * x + k[5]), 0, 1))

    exposures = [start + i * (stop - start) / (count - 1) for i in range(count)]
    return start, stop, count, np.max([ldr_flip(screen(reference, e), screen(test, e)) for e in exposures], axis=0)


def main():
    r = base()
    for name, t in (("noise", np.clip(r + 0.3 * (noise(7) - 0.5), 0, 1)), ("shift", np.roll(r, 2, axis=1)),
                    ("tint", np.clip(r * np.array([1.0, 0.8, 0.6]), 0, 1))):
        s = structural_similarity(r @ LUMINANCE, t @ LUMINANCE, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0)
        f = ldr_flip(r, t)
        print(f"LDR {name}: SSIM {s:.9f}; FLIP mean {f.mean():.9f}, largest {f.max():.9f}, at (10, 20) {f[20, 10]:.9f}")
    r = 20 * r**4
    for name, a, b in (("noise", r, r * (0.4 + 1.2 * noise(11))), ("shift", r, np.roll(r, 1, axis=0)), ("dark", 0.01 * r, 0.009 * r)):
        start, stop, count, f = hdr_flip(a, b)
        print(f"HDR {name}: {count} exposures from {start:.6f} to {stop:.6f}; mean {f.mean():.9f}, largest {f.max():.9f}, "
              f"at (10, 20) {f[20, 10]:.9f}")


main()
