#!/usr/bin/env python3
"""Quotes against what became of them: samples and CPU time.

For each scene and error, `woodcock quote` and then `woodcock render` of as many samples. CPU times are user seconds of the
render alone, as both programs count them. Prints Markdown. Wants a quiet machine: other work changes CPU times by 15 % and more.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def run_json(program, *arguments):
    done = subprocess.run([program, *arguments, '--json'], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f'quotes.py: {" ".join(arguments)}: exit code {done.returncode}\n{done.stderr}')
    return json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('scenes', nargs='*', default=[str(ROOT / f'scenes/paper/{name}.pbrt') for name in ('fig02', 'fig06', 'fig10')])
    parser.add_argument('--errors', default='5%,2%', help='as of woodcock quote --error, with commas (default %(default)s)')
    parser.add_argument('--resolution', default='128x96', help='default %(default)s')
    parser.add_argument('--program', default=str(ROOT / 'build/release/bin/woodcock'))
    options = parser.parse_args()
    print('| scene | error | samples quoted | needed | CPU s quoted | taken | off | uncertain |\n|---|---|---|---|---|---|---|---|')
    held = cases = 0
    for scene in options.scenes:
        for error in options.errors.split(','):
            quote = run_json(options.program, 'quote', scene, '--error', error, '--resolution', options.resolution)
            with tempfile.TemporaryDirectory() as folder:
                render = run_json(options.program, 'render', scene, '-o', f'{folder}/out.exr', '--spp', str(quote['samples']),
                                  '--resolution', options.resolution)
            needed = quote['samples'] * (render['error']['relative_error'] / quote['relative_error']) ** 2
            seconds = render['convergence']['points'][-1]['cpu_seconds']
            off = seconds / quote['cpu_seconds'] - 1
            cases += 1
            held += abs(off) <= 0.15 and abs(needed / quote['samples'] - 1) <= 0.1
            print(f'| {Path(scene).stem} | {error} | {quote["samples"]} | {needed:.0f} | {quote["cpu_seconds"]:.3g} | {seconds:.3g} '
                  f'| {100 * off:+.1f} % | {quote["uncertain"]} |', flush=True)
    print(f'\n{held} of {cases} held: samples within 10 %, CPU time within 15 %.')


if __name__ == '__main__':
    main()
