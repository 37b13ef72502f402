# SPDX-License-Identifier: GPL-3.0-or-later
"""What must not grow with the number of updates."""
import gc
import os
import sys

import bpy
import numpy as np
import pytest
from conftest import bind, evaluated, make_strip, update

UPDATES = 10_000


def memory():
    """Bytes of this process that are in memory."""
    with open('/proc/self/statm') as file:
        return int(file.read().split()[1]) * os.sysconf('SC_PAGE_SIZE')


def state():
    handlers = [f for name in dir(bpy.app.handlers) if isinstance(f := getattr(bpy.app.handlers, name), list)]
    return {'threads': len(os.listdir('/proc/self/task')), 'files': len(os.listdir('/proc/self/fd')),
            'handlers': sum(map(len, handlers)), 'meshes': len(bpy.data.meshes),
            'objects': len(bpy.data.objects), 'node groups': len(bpy.data.node_groups),
            'attributes': len(bpy.context.object.data.attributes)}


@pytest.mark.skipif(sys.platform != 'linux', reason="reads /proc")
def test_nothing_grows_over_many_updates():
    ob = bind(make_strip(21))
    empty = ob.detail_deform.handles[0].target

    def move(count):
        for step in range(count):
            empty.location.z = 0.2 * np.sin(0.1 * step) + 0.001 * step / count
            update()

    ob.detail_deform.refine = 4  # its data is made by the first update that asks for it
    move(300)
    gc.collect()
    before, at_first = memory(), state()
    move(UPDATES)
    gc.collect()
    assert state() == at_first
    assert memory() - before < 4e6
    assert np.abs(evaluated(ob)[:, 2]).max() > 0.05


@pytest.mark.skipif(sys.platform != 'linux', reason="reads /proc")
def test_binding_again_and_again_leaves_no_thread_and_little_memory():
    ob = bind(make_strip(41))
    for _ in range(5):
        bind(ob)
        bpy.ops.object.detail_deform_unbind()
    bind(ob)
    gc.collect()
    before, at_first = memory(), state()
    for _ in range(40):
        bpy.ops.object.detail_deform_unbind()
        bind(ob)
    gc.collect()
    assert state() == at_first
    assert memory() - before < 20e6
