# SPDX-License-Identifier: GPL-3.0-or-later
"""A bumpy sheet, fixed at one side and pulled by a handle at the other: pip install ./native/python."""

import detail_deform_native as dd
import numpy as np

N = 30
x, y = (grid.ravel() for grid in np.meshgrid(np.arange(N), np.arange(N), indexing='ij'))
positions = np.stack([x, y, 0.4 * np.sin(2 * x) * np.cos(2 * y)], axis=1).astype(np.float32)
corner = (np.arange(N - 1)[:, None] * N + np.arange(N - 1)).ravel()
triangles = np.concatenate([np.stack([corner, corner + N, corner + N + 1], 1),
                            np.stack([corner, corner + N + 1, corner + 1], 1)]).astype(np.int32)
roles = np.full(N * N, dd.ROLE_FREE, np.int32)
roles[x == 0] = dd.ROLE_FIXED
roles[x == N - 1] = 0

deformer = dd.Bind(positions, triangles, roles, 1).finish()
lift = np.eye(4)[None, :3].copy()
lift[0, 2, 3] = 8
result = positions + deformer.offsets(lift).reshape(-1, 3)
print(f"{deformer.info.free_count} vertices follow; the middle rose by {result[x == N // 2, 2].mean():.2f}")
assert np.allclose(result[roles == 0, 2], positions[roles == 0, 2] + 8, atol=1e-4)
