# SPDX-License-Identifier: GPL-3.0-or-later
"""Text files of pairs of corresponding triangles or vertices."""

import contextlib
import os

import numpy as np

from ..scene import correspondence, files, mesh_data
from ..scene.mesh_data import MeshProblem

_HEADERS = {'TRIANGLES': "pairs of triangles", 'VERTICES': "pairs of vertices"}  # in the header of write_pairs()


def read_pairs(path, pairs_of):
    """Reads (k, 2) int32: one pair a line, source then target, 0-based. pairs_of: 'TRIANGLES' or 'VERTICES'.

    Separators are white space, commas, colons and semicolons. Further columns, comments after # and single numbers
    before the first pair (a count) are ignored. Raises MeshProblem."""
    pairs = []
    if not path:
        raise MeshProblem("There is no list yet: choose a file in List, or another way in Match By.")
    try:
        for number, line in enumerate(files.read_lines(path), 1):
            in_header = next((kind for kind in _HEADERS if _HEADERS[kind] in line), pairs_of)
            if in_header != pairs_of:
                raise MeshProblem(f"'{path}' says that it holds pairs of {in_header.lower()}: choose that (Pairs of).")
            words = line.split('#')[0].replace(',', ' ').replace(';', ' ').replace(':', ' ').split()
            if not words or (len(words) == 1 and not pairs and words[0].isdigit()):
                continue
            try:
                pairs.append([int(words[0]), int(words[1])])
            except (ValueError, IndexError) as error:
                raise MeshProblem(
                    f"'{path}', line {number}: '{line.strip()[:40]}' is not a pair of numbers.") from error
    except OSError as error:
        raise MeshProblem(f"'{path}' can't be read: {files.reason(error, path)}.") from error
    if not pairs:
        raise MeshProblem(f"'{path}' has no pairs of numbers: write one pair a line, source then target.")
    limit = np.iinfo(np.int32).max
    if max(max(map(abs, pair)) for pair in pairs) > limit:
        raise MeshProblem(f"'{path}' has a number over {limit:,}.")
    return np.array(pairs, np.int32)


def pairs_of_file(path, otherwise):
    """The pairs_of that the header of a file by write_pairs() names; `otherwise` for any other file."""
    try:
        with contextlib.closing(files.read_lines(path)) as lines:
            first = next(lines, "")
    except OSError:  # read_pairs() reports it
        return otherwise
    return next((kind for kind in _HEADERS if _HEADERS[kind] in first), otherwise)


def write_pairs(path, matched):
    """Writes the pairs in the format of read_pairs(). An existing file is replaced only once the new one is complete.
    Raises MeshProblem."""
    if matched.pairs is None:
        raise MeshProblem("A Saved Match by Nearest has no list of pairs: it is found by how the meshes stand.")
    unfinished = ""
    try:
        unfinished = files.unfinished(path)
        np.savetxt(unfinished, matched.pairs, fmt='%d',
                   header=f"{_HEADERS[matched.pairs_of]}, source and target, from 0")
        os.replace(unfinished, path)
    except OSError as error:
        files.remove_unfinished(unfinished)
        raise MeshProblem(f"'{path}' can't be written: {files.reason(error, path)}.") from error


def by_list(source, target, path, pairs_of):
    """The Correspondence of a file of pairs. Raises MeshProblem, also for numbers out of range."""
    matched = correspondence.Correspondence(mesh_data.triangles(source.data), mesh_data.triangles(target.data),
                                            read_pairs(path, pairs_of), None)
    counts = {'TRIANGLES': (len(matched.source_triangles), len(matched.target_triangles)),
              'VERTICES': (len(source.data.vertices), len(target.data.vertices))}[pairs_of]
    outside = np.argwhere((matched.pairs < 0) | (matched.pairs >= counts))
    if len(outside):
        row, side = outside[0]
        raise MeshProblem(f"'{path}': pair {row + 1} names number {matched.pairs[row, side]} of "
                          f"'{(source, target)[side].name}', which has {counts[side]:,} {pairs_of.lower()}, "
                          "counted from 0.")
    matched.pairs_of = pairs_of
    paired = np.zeros(counts[1], np.float32)
    paired[matched.pairs[:, 1]] = 1
    matched.confidence = paired if pairs_of == 'TRIANGLES' else paired[matched.target_triangles].mean(1)
    return matched
