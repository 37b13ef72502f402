# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives the zoo through the add-on, in child processes that may crash, and prints a table of the outcomes.

    python3 tests/blender/zoo/run.py                            each kind alone, with all methods
    python3 tests/blender/zoo/run.py --pairs [--only TEXT]      all pairs of kinds, or those with TEXT in their name
    python3 tests/blender/zoo/run.py FILE...                    meshes and .blend files: .blend .obj .ply .stl .off .glb

--blender COMMAND: Blender (default: blender), or the Python of an environment that has bpy. --share N: one in N of the
pairs, of which there are 30,000. --all: prints each case.
Needs a release build. The exit status is 1 if there is a failure.
"""
import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[2]
MANUAL = REPOSITORY / 'addon' / 'MANUAL.md'
_SECONDS, _SECONDS_OF_FILE = 120, 900  # limits for one case and for one file


def cases(arguments):
    """{name of a case: function of the manual's rows that drives it}. Runs in Blender."""
    from zoo import files, kinds
    from zoo.driver import drive
    if arguments.files:
        return {f"{Path(file).name}: {how}": lambda rows, file=file, how=how: files.drive_file(file, how, rows)
                for file in arguments.files for how in files.HOWS}
    made = kinds.pairs(arguments.share) if arguments.pairs else kinds.alone()
    return {case.name: lambda rows, case=case: drive(case, rows) for case in made
            if all(text in case.name for text in arguments.only)}


def child(arguments):
    """Runs in Blender: drives the cases that the log doesn't have yet. Writes a line when a case begins, and one with
    its outcome."""
    sys.path[:0] = [str(HERE.parent), str(REPOSITORY / 'addon')]
    import detail_deform

    from zoo.driver import patterns
    detail_deform.register()
    rows = patterns(MANUAL.read_text(encoding='utf-8'))
    done = {line['name'] for line in read(arguments.log)}
    with open(arguments.log, 'a', encoding='utf-8') as log:
        for name, drive in cases(arguments).items():
            if name in done:
                continue
            tell(log, name=name)
            start = time.perf_counter()
            try:
                outcome = drive(rows)
            except Exception as error:  # in the zoo's own code, or by Blender
                import traceback
                outcome = ('failure', f"{error!r} {traceback.format_exc()[-1500:]}")
            kind, text = outcome or ('none', "")
            tell(log, name=name, kind=kind, text=text, seconds=round(time.perf_counter() - start, 2))
        tell(log, name="", kind='end', text="")
    detail_deform.unregister()


def tell(log, **line):
    print(json.dumps(line), file=log, flush=True)


def read(path):
    with open(path, encoding='utf-8', errors='replace') as log:
        return [json.loads(line) for line in log]


def is_python(command):
    return 'python' in Path(command).name


def drive_all(arguments):
    """Runs child processes until all cases are driven; returns the log's lines of outcomes."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, 'log')
        log.touch()
        own = [str(HERE / 'run.py')]
        if not is_python(arguments.blender):
            own = ['--background', '--factory-startup', '--python', *own, '--']
        while not (lines := read(log)) or lines[-1].get('kind') != 'end':
            run_child([arguments.blender, *own, '--log', str(log), *sys.argv[1:]], log,
                      _SECONDS_OF_FILE if arguments.files else _SECONDS)
            found = read(log)
            if len(found) == len(lines):
                sys.exit(f"The zoo did not start:\n{Path(folder, 'console').read_text(errors='replace')[-2000:]}")
            if 'kind' not in found[-1]:
                with open(log, 'a', encoding='utf-8') as more:
                    tell(more, name=found[-1]['name'], kind='failure', text="crash, or no end")
        return [line for line in lines if line.get('kind') not in {None, 'none', 'end'}]


def run_child(command, log, seconds):
    """Runs a process until it ends, or kills it after so many seconds without a new line in the log."""
    with open(log.with_name('console'), 'w') as console, \
            subprocess.Popen(command, stdout=console, stderr=subprocess.STDOUT) as process:
        while process.poll() is None:
            if time.time() - log.stat().st_mtime > seconds:
                process.kill()
            time.sleep(0.2)


def table(lines, kinds_of):
    """(kind, results, sentences, failures) for each kind. kinds_of: gives the kinds in the name of a case."""
    counts = {}
    for line in lines:
        for kind in kinds_of(line['name']):
            counts.setdefault(kind, Counter())[line['kind']] += 1
    return [(kind, count['result'], count['sentence'], count['failure']) for kind, count in counts.items()]


def print_table(rows):
    width = max([len(row[0]) for row in rows] + [4])
    print(f"{'kind':{width}} {'result':>8} {'sentence':>9} {'failure':>8}")
    for name, *counts in rows:
        print(f"{name:{width}} {counts[0]:8} {counts[1]:9} {counts[2]:8}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('files', nargs='*')
    parser.add_argument('--pairs', action='store_true')
    parser.add_argument('--only', action='append', default=[])
    parser.add_argument('--share', type=int, default=1)
    parser.add_argument('--blender', default='blender')
    parser.add_argument('--all', action='store_true')
    parser.add_argument('--log', help=argparse.SUPPRESS)
    arguments = parser.parse_args(sys.argv[sys.argv.index('--') + 1:] if '--' in sys.argv else None)
    if arguments.log:
        return child(arguments)
    lines = drive_all(arguments)
    for line in lines:
        if arguments.all or line['kind'] == 'failure':
            print(f"{line['kind'].upper()} {line['name']} ({line.get('seconds', 0)} s): {line['text']}")
    print_table(table(lines, lambda name: [name] if arguments.files else name.split(' + ')))
    counts = Counter(line['kind'] for line in lines)
    print(f"{len(lines)} cases: {counts['result']} results, {counts['sentence']} with sentences, "
          f"{counts['failure']} failures")
    return 1 if counts['failure'] or not lines else 0


if __name__ == '__main__':
    sys.exit(main())
