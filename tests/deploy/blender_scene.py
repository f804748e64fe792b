"""For Blender: a scene with what deploy/blender/export.py takes, saved as FOLDER/shot.blend; with CYCLES also rendered by Cycles.

    blender -b --factory-startup -P blender_scene.py -- FOLDER LAMP [CYCLES]

LAMP: point, area, disk, spot, blended-spot, sun, world, environment or emission, which alone lights the scene."""
import math
import sys
from pathlib import Path

import bpy

folder, lamp = Path(sys.argv[sys.argv.index("--") + 1]), sys.argv[sys.argv.index("--") + 2]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene


def principled(name, **values):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    node = material.node_tree.nodes["Principled BSDF"]
    for key, value in values.items():
        node.inputs[key.replace("_", " ")].default_value = value
    return material


# An image whose four quarters differ: a turned or mirrored texture shows.
def quarters(name, colors, size=32, is_float=False):
    image = bpy.data.images.new(name, size, size // (2 if is_float else 1), float_buffer=is_float)
    width, height = image.size
    pixels = []
    for y in range(height):
        for x in range(width):
            pixels += [*colors[(2 if y >= height / 2 else 0) + (1 if x >= width / 2 else 0)], 1]
    image.pixels = pixels
    image.pack()
    return image


bpy.ops.mesh.primitive_plane_add(size=8)
floor = bpy.context.object
floor.data.materials.append(principled("floor", Base_Color=(0.6, 0.6, 0.6, 1), Roughness=1, Specular=0))
bpy.ops.mesh.primitive_plane_add(size=2, location=(0.2, 0.6, 1.05), rotation=(math.radians(80), 0, math.radians(10)))
picture = principled("picture", Roughness=1, Specular=0)
node = picture.node_tree.nodes.new("ShaderNodeTexImage")
node.image = quarters("picture", [(0.8, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8), (0.8, 0.8, 0.1)])
picture.node_tree.links.new(node.outputs["Color"], picture.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
bpy.context.object.data.materials.append(picture)
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(-1.2, -0.6, 0.5))
bpy.ops.object.shade_smooth()
bpy.context.object.data.materials.append(principled("plastic", Base_Color=(0.2, 0.5, 0.7, 1), Roughness=0.5, Specular=0.5))
bpy.ops.mesh.primitive_cube_add(size=0.8, location=(1.4, -0.8, 0.4), rotation=(0, 0, 0.5))
bpy.context.object.scale = (1, -0.8, 1.2)  # a mirrored one
bpy.context.object.data.materials.append(principled("metal", Base_Color=(0.9, 0.6, 0.3, 1), Metallic=1, Roughness=0.5))

scene.world = bpy.data.worlds.new("world")
scene.world.use_nodes = True
background = scene.world.node_tree.nodes["Background"]
background.inputs["Strength"].default_value = 0


def add_lamp(kind, energy, location, rotation, **more):
    bpy.ops.object.light_add(type=kind, location=location, rotation=rotation)
    data = bpy.context.object.data
    data.energy, data.color = energy, (1, 0.9, 0.8)
    for key, value in more.items():
        setattr(data, key, value)


if lamp == "point":
    add_lamp("POINT", 400, (1.5, -2.5, 3.5), (0, 0, 0), shadow_soft_size=0.3)
elif lamp == "area":
    add_lamp("AREA", 200, (1.5, -2.5, 3.5), (0.6, 0.35, 0), shape="RECTANGLE", size=1, size_y=0.5)
elif lamp == "disk":
    add_lamp("AREA", 200, (1.5, -2.5, 3.5), (0.6, 0.35, 0), shape="DISK", size=1)
elif lamp == "spot":
    add_lamp("SPOT", 800, (1.5, -2.5, 3.5), (0.6, 0.35, 0), spot_size=math.radians(90), spot_blend=0, shadow_soft_size=0)
elif lamp == "blended-spot":
    add_lamp("SPOT", 800, (1.5, -2.5, 3.5), (0.6, 0.35, 0), spot_size=math.radians(70), spot_blend=0.6, shadow_soft_size=0)
elif lamp == "sun":
    add_lamp("SUN", 3, (0, 0, 5), (0.6, 0.35, 0), angle=0)
elif lamp == "world":
    background.inputs["Strength"].default_value = 0.7
    background.inputs["Color"].default_value = (0.5, 0.7, 1, 1)
elif lamp == "environment":
    background.inputs["Strength"].default_value = 1
    node = scene.world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = quarters("sky", [(0.2, 0.1, 0.1), (0.1, 0.2, 0.1), (0.3, 0.3, 2), (2, 2, 0.3)], 64, True)
    scene.world.node_tree.links.new(node.outputs["Color"], background.inputs["Color"])
elif lamp == "emission":
    bpy.ops.mesh.primitive_plane_add(size=1, location=(1.5, -2.5, 3.5), rotation=(math.pi, 0, 0))
    bpy.context.object.data.materials.append(principled("glow", Base_Color=(0, 0, 0, 1), Specular=0, Emission=(1, 0.9, 0.8, 1), Emission_Strength=20))
else:
    sys.exit(f"there is no lamp {lamp}")

bpy.ops.object.camera_add(location=(0.5, -6, 2.6), rotation=(math.radians(72), 0, math.radians(4)))
scene.camera = bpy.context.object
scene.camera.data.lens = 40
scene.camera.data.shift_x, scene.camera.data.shift_y = 0.03, -0.05
scene.render.engine = "CYCLES"
scene.render.resolution_x, scene.render.resolution_y = 96, 64
scene.cycles.samples = 256
scene.cycles.use_adaptive_sampling = False
scene.cycles.use_denoising = False
scene.cycles.sample_clamp_indirect = 0
scene.cycles.max_bounces = scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 32
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
scene.render.image_settings.color_mode = "RGB"
scene.render.filepath = str(folder / "cycles.exr")
bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
if "CYCLES" in sys.argv:
    bpy.ops.render.render(write_still=True)
