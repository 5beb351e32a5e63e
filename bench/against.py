#!/usr/bin/env python3
"""Efficiency of this version over an older one, scene by scene.

Both programs render the same scenes with the same numbers of samples, in turn and with other seeds each round. The error of a picture is
its relative mean squared error against a reference that this version renders with many samples, in two halves: what they differ by is the
reference's own noise, which is taken off. Time is user CPU seconds of the whole program, loading included. Efficiency is
1 / (error x time). Prints a Markdown table.

A ratio above one: this version needs that many times less time for the same error. The spread is that of the rounds, each a pair of runs
next to each other, so that other work on the machine changes little. `mean` is that of the old pictures over that of the reference, less one:
beyond its noise, the two versions do not compute the same picture.
"""

import argparse
import array
import math
import os
import random
import statistics
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
REFERENCE_SEEDS = (900001, 900002)


def dense_cloud():
    """A cloud of albedo 0.9999 and g 0.85 in a 40^3 grid, above ground, under sun and sky."""
    n = 40
    values = []
    for z in range(n):
        for y in range(n):
            for x in range(n):
                p = [2 * (i + 0.5) / n - 1 for i in (x, y, z)]
                bumps = math.sin(7 * p[0] + 2 * p[2]) * math.sin(6 * p[1] - p[0]) * math.sin(8 * p[2] + 3 * p[1])
                values.append(max(0.0, min(1.0, 4 * (0.75 - math.hypot(*p) + 0.25 * bumps))))
    density = ' '.join(f'{v:.3g}' for v in values)
    return f'''LookAt 0 -5 1.5  0 0 1.2  0 0 1
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 96 "integer yresolution" 72
Integrator "volpath" "integer maxdepth" 2000
WorldBegin
LightSource "infinite" "rgb L" [ 0.3 0.45 0.8 ]
LightSource "distant" "rgb L" [ 4 3.7 3.2 ] "point3 from" [ 2 -1 3 ] "point3 to" [ 0 0 0 ]
Material "diffuse" "rgb reflectance" [ 0.2 0.25 0.15 ]
Shape "disk" "float radius" 20
MakeNamedMedium "cloud" "string type" "uniformgrid" "integer nx" {n} "integer ny" {n} "integer nz" {n}
  "point3 p0" [ -1 -1 0.3 ] "point3 p1" [ 1 1 2.3 ] "float g" 0.85
  "rgb sigma_s" [ 39.996 39.996 39.996 ] "rgb sigma_a" [ 0.004 0.004 0.004 ] "float density" [ {density} ]
MediumInterface "cloud" ""
Material "interface"
Shape "trianglemesh" "integer indices" [ 0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7 ]
  "point3 P" [ -1 -1 0.3 1 -1 0.3 1 1 0.3 -1 1 0.3 -1 -1 2.3 1 -1 2.3 1 1 2.3 -1 1 2.3 ]
'''


def many_lights():
    """1000 point, spot and sphere lights over a street in fog, their powers within a range of 256."""
    numbers = random.Random(1000)
    uniform = numbers.uniform
    text = '''MakeNamedMedium "fog" "string type" "homogeneous" "rgb sigma_s" [ 0.03 0.03 0.03 ] "rgb sigma_a" [ 0.003 0.003 0.003 ]
LookAt 0 -24 5  0 0 1  0 0 1
MediumInterface "" "fog"
Camera "perspective" "float fov" 50
Film "rgb" "integer xresolution" 96 "integer yresolution" 64
Integrator "volpath" "integer maxdepth" 8
WorldBegin
MediumInterface "fog" "fog"
Material "diffuse" "rgb reflectance" [ 0.4 0.4 0.4 ]
Shape "disk" "float radius" 60
'''
    for i in range(1000):
        x, y, z = uniform(-20, 20), uniform(-20, 20), uniform(0.3, 6)
        power = 2 ** uniform(-4, 4)
        if i % 3 == 0:
            text += f'LightSource "point" "point3 from" [ {x} {y} {z} ] "rgb I" [ {power} {power} {power} ]\n'
        elif i % 3 == 1:
            text += (f'LightSource "spot" "point3 from" [ {x} {y} {z} ] "point3 to" [ {x + uniform(-1, 1)} {y + uniform(-1, 1)} 0 ] '
                     f'"float coneangle" 35 "rgb I" [ {4 * power} {4 * power} {4 * power} ]\n')
        else:
            text += (f'AttributeBegin\nTranslate {x} {y} {z}\nAreaLightSource "diffuse" "rgb L" [ {100 * power} {100 * power} {100 * power} ]\n'
                     'Shape "sphere" "float radius" 0.05\nAttributeEnd\n')
    return text


GENERATED = {'dense-cloud': dense_cloud, 'many-lights': many_lights}


def render(program, scene, out, spp, seed, options):
    """User CPU seconds of the render."""
    command = [program, 'render', str(scene), '-o', str(out), '--spp', str(spp), '--seed', str(seed), '--threads', str(options.threads)]
    if options.resolution:
        command += ['--resolution', options.resolution]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    log = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    # 3: rendered, with something to look at.
    if process.returncode not in (0, 3):
        raise SystemExit(f'against.py: {" ".join(command)}: exit code {process.returncode}\n{log}')
    return usage.ru_utime


def read_picture(path, folder):
    """Red, green and blue of all pixels in one array of floats, row by row, each row blue first: the order of an EXR's channels."""
    plain = Path(folder) / 'plain.exr'
    done = subprocess.run(['oiiotool', str(path), '--ch', 'R,G,B', '-d', 'float', '--scanline', '--compression', 'none', '-o', str(plain)],
                          capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f'against.py: oiiotool cannot read {path} (Debian: apt install openimageio-tools)\n{done.stderr}{done.stdout}')
    data = plain.read_bytes()
    at = 8  # after the magic number and the version
    window = None
    while data[at] != 0:
        name, kind, rest = data[at:at + 512].split(b'\0', 2)
        at += len(name) + len(kind) + 2
        size = struct.unpack_from('<i', data, at)[0]
        if name == b'dataWindow':
            window = struct.unpack_from('<4i', data, at + 4)
        at += 4 + size
    width, height = window[2] - window[0] + 1, window[3] - window[1] + 1
    at += 1
    values = array.array('f')
    # One row a chunk: its y, its size, then all of each channel.
    for offset in struct.unpack_from(f'<{height}Q', data, at):
        size = struct.unpack_from('<i', data, offset + 4)[0]
        if size != 3 * 4 * width:
            raise SystemExit(f'against.py: {plain}: a row of {size} bytes, expected three channels of {width} floats')
        values.frombytes(data[offset + 8:offset + 8 + size])
    if sys.byteorder != 'little':
        values.byteswap()
    return values


class Reference:
    """The mean of two halves, and what its own noise adds to an error against it."""

    def __init__(self, a, b):
        self.values = [(x + y) / 2 for x, y in zip(a, b)]
        mean = sum(self.values) / len(self.values)
        # Keeps black pixels from deciding; relative, so that the exposure does not matter.
        self.floor = 0.01 * mean * mean
        self.mean = mean
        self.noise = statistics.fmean((x - y) ** 2 / 4 / (r * r + self.floor) for x, y, r in zip(a, b, self.values))

    def error(self, picture):
        return statistics.fmean((x - r) ** 2 / (r * r + self.floor) for x, r in zip(picture, self.values)) - self.noise


def compare(old, new, scene, spp, options, folder):
    out = Path(folder) / 'out.exr'

    def picture(program, samples, seed):
        seconds = render(program, scene, out, samples, seed, options)
        values = read_picture(out, folder)
        for file in Path(folder).glob('out.*'):
            file.unlink()
        return values, seconds

    reference = Reference(*(picture(new, spp * options.reference // 2, seed)[0] for seed in REFERENCE_SEEDS))
    errors = {old: [], new: []}
    times = {old: [], new: []}
    means = []
    for i in range(options.rounds):
        for program in (old, new) if i % 2 == 0 else (new, old):
            values, seconds = picture(program, spp, options.seed + i)
            errors[program].append(reference.error(values))
            times[program].append(seconds)
            if program == old:
                means.append(sum(values) / len(values) / reference.mean - 1)
    if min(statistics.fmean(e) for e in errors.values()) <= 0:
        raise SystemExit(f'against.py: {scene}: the reference is noisier than what it judges; give more samples with --reference')

    def ratio(rounds):
        product = [statistics.fmean(errors[p][i] for i in rounds) * statistics.fmean(times[p][i] for i in rounds) for p in (old, new)]
        return product[0] / product[1]

    single = [ratio([i]) for i in range(options.rounds)]
    spread = f'{min(single):.2f} to {max(single):.2f}'
    off = statistics.fmean(means)
    noise = statistics.stdev(means) / math.sqrt(len(means)) if len(means) > 1 else math.nan
    return (f'| {Path(scene).stem} | {spp} | {statistics.fmean(errors[old]):.3g} | {statistics.fmean(errors[new]):.3g} '
            f'| {statistics.fmean(times[old]):.2f} | {statistics.fmean(times[new]):.2f} | **{ratio(range(options.rounds)):.2f}** | {spread} '
            f'| {100 * off:+.1f} ± {100 * noise:.1f} % |')


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('old', help='the woodcock program of the older version')
    parser.add_argument('scenes', nargs='*', help='scene files, or the names ' + ' and '.join(GENERATED) + ' of scenes made here (default: these and all of scenes/)')
    parser.add_argument('--program', default=str(ROOT / 'build/release/bin/woodcock'), help='of this version (default %(default)s)')
    parser.add_argument('--spp', type=int, default=16, help='samples per pixel (default %(default)s)')
    parser.add_argument('--rounds', type=int, default=4, help='pairs of runs a scene (default %(default)s)')
    parser.add_argument('--reference', type=int, default=64, help="the reference's samples as a multiple of --spp (default %(default)s)")
    parser.add_argument('--resolution', default='128x96', help="e.g. 128x96, or '' for that of each scene (default %(default)s)")
    parser.add_argument('--seed', type=int, default=1, help='of the first round (default %(default)s)')
    parser.add_argument('--threads', type=int, default=1, help='default %(default)s')
    options = parser.parse_intermixed_args()
    if options.spp < 1 or options.rounds < 1 or options.reference < 2:
        parser.error('expected --spp and --rounds of 1 or more, --reference of 2 or more')
    # Names without a folder are files, not commands.
    options.old, options.program = (str(Path(p).resolve()) for p in (options.old, options.program))
    for program in (options.old, options.program):
        if not os.access(program, os.X_OK):
            parser.error(f'found no program {program}, expected the path of a woodcock to run')
    scenes = options.scenes or [*sorted(str(p) for p in (ROOT / 'scenes').glob('*.pbrt')), *GENERATED]
    print('| scene | samples | error before | error now | s before | s now | efficiency, now over before | of single rounds | mean before |\n'
          '|---|---|---|---|---|---|---|---|---|')
    with tempfile.TemporaryDirectory() as folder:
        for scene in scenes:
            if scene in GENERATED:
                path = Path(folder) / f'{scene}.pbrt'
                path.write_text(GENERATED[scene]())
                scene = path
            print(compare(options.old, options.program, scene, options.spp, options, folder), flush=True)


if __name__ == '__main__':
    main()
