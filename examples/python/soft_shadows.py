# %% [markdown]
# # Soft shadows on NumPy arrays
# A notebook in cells: open it in an editor that knows `# %%`, or run it: `python3 soft_shadows.py [PICTURE.png]`.

# %%
import struct
import sys
import zlib

import numpy as np

import halfshade

# %% [markdown]
# ## A scene
# A ring of boxes on a floor. Meshes are arrays: positions (n, 3), triangles (m, 3). One mesh may stand in many places.

# %%
corners = np.array([(x, y, z) for x in (-1, 1) for y in (0, 2) for z in (-1, 1)], np.float32)
faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
box = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))], np.uint32)

scene = halfshade.Scene()
for k in range(9):
    angle = 2 * np.pi * k / 9
    size, height = 0.35, 0.3 + 0.12 * k
    place = np.array(
        [
            [size * np.cos(angle), 0, size * np.sin(angle), 3 * np.cos(angle)],
            [0, height, 0, 0],
            [-size * np.sin(angle), 0, size * np.cos(angle), 3 * np.sin(angle)],
        ]
    )
    scene.add_mesh(corners, box, transform=place, albedo=(0.9, 0.6 - 0.05 * k, 0.3))
floor = np.array([(-6, 0, -6), (-6, 0, 6), (6, 0, 6), (6, 0, -6)], np.float32)
scene.add_mesh(floor, np.array([(0, 1, 2), (0, 2, 3)], np.uint32))

# %% [markdown]
# ## Lights
# A square above and a small sphere at the side.

# %%
lights = [
    halfshade.Light.rectangle((0, 6, 0), (2, 0, 0), (0, 0, 2), emission=(16, 16, 16)),
    halfshade.Light.sphere((-5, 2, 3), 0.4, emission=(60, 40, 20)),
]
for light in lights:
    scene.extend(light)
scene.commit()

# %% [markdown]
# ## What the camera sees, and how much of each light reaches it

# %%
gbuffer = scene.rasterize(480, 320, eye=(0, 6, 9), target=(0, 0.5, 0), fov_y_deg=40)
solver = halfshade.Solver(light_sample_count=64)
result = solver.solve(scene, gbuffer, lights, masks=True, visibility=True, total_irradiance=True)
print("masks", result.masks.shape, "visibility", result.visibility.shape)

# %% [markdown]
# ## A picture

# %%
light_reaching = result.total_irradiance / np.pi + 0.06  # a little light from everywhere
linear = np.where((gbuffer.triangle == halfshade.NONE)[..., None], 0.02, gbuffer.albedo * light_reaching)
srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
picture = (np.clip(srgb, 0, 1) * 255 + 0.5).astype(np.uint8)


def write_png(path, rgb):
    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    height, width, _ = rgb.shape
    rows = np.pad(rgb.reshape(height, width * 3), ((0, 0), (1, 0)))  # each row starts with filter 0
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        file.write(chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)))
        file.write(chunk(b"IDAT", zlib.compress(rows.tobytes())))
        file.write(chunk(b"IEND", b""))


write_png(sys.argv[1] if len(sys.argv) > 1 else "soft_shadows.png", picture)

# %% [markdown]
# ## A frame later
# One box moves; only what it changes is made anew. The result goes into the same memory.

# %%
lifted = np.array([[0.5, 0, 0, 0], [0, 0.5, 0, 2], [0, 0, 0.5, 0]])
scene.set_transform(0, lifted)
scene.commit()
gbuffer = scene.rasterize(480, 320, eye=(0, 6, 9), target=(0, 0.5, 0), fov_y_deg=40)
before = result.visibility.copy()
solver.visibility(scene, gbuffer, lights, out=result.visibility)
print("pixels that changed:", int(np.count_nonzero((before != result.visibility).any(axis=0))))
