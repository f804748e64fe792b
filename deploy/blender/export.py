"""Writes the scene of a Blender file for Candela: FOLDER/scene.xml (Mitsuba 3), meshes as PLY, textures beside it.

    blender -b shot.blend -P export.py -- FOLDER [--frame N] [--spp N]

It takes the camera, lamps, meshes (and all that Blender turns into meshes), materials of one Principled BSDF or
Emission with image textures, and the world's color or environment texture. It warns of each thing that it leaves out.
Tried with Blender 3.4; docs/from-blender.md has the list. One Blender unit is one unit of the scene; z is up, as in Blender.
"""
import argparse
import math
import os
import re
import shutil
import sys
from pathlib import Path
from xml.sax.saxutils import quoteattr

import bpy
import numpy as np
from mathutils import Matrix

# A spot of Cycles has the intensity of a point lamp, times the cosine to its axis (up to Blender 3.4), times
# smoothstep((cosine - c) / ((1 - c) blend)), where c is the cosine at its edge: kernel/light/spot.h of Cycles.
FADING_SPOTS = bpy.app.version < (3, 5, 0)
WIDEST_SPOT = math.radians(85)  # half of its angle: a picture that is projected onto a plane has an end
SPOT_PIXELS = 256

warned = set()


def warn(text):
    if text not in warned:
        warned.add(text)
        print(f"export.py: warning: {text}", file=sys.stderr)


def number(value):
    return f"{float(value):.9g}"


def numbers(values):
    return ", ".join(number(value) for value in values)


def matrix(m):
    return f'<transform name="to_world"><matrix value="{" ".join(number(v) for row in m for v in row)}"/></transform>'


class Export:
    def __init__(self, folder, spp):
        self.folder = Path(folder)
        self.scene = bpy.context.scene
        self.spp = spp
        self.lines = []
        self.names = {}  # of files and ids that are given away
        self.textures = {}
        self.materials = {}
        for part in ("meshes", "textures"):
            (self.folder / part).mkdir(parents=True, exist_ok=True)

    def name(self, wanted):
        """A name that no other thing has, of letters that every file system takes."""
        base = re.sub(r"[^A-Za-z0-9_-]+", "_", wanted).strip("_") or "unnamed"
        count = self.names.get(base.lower(), 0)
        self.names[base.lower()] = count + 1
        return base if count == 0 else self.name(f"{base}_{count + 1}")

    def write(self):
        self.lines = ['<scene version="3.0.0">', '  <integrator type="path"/>']
        self.camera()
        self.world()
        bodies = []
        graph = bpy.context.evaluated_depsgraph_get()
        for instance in graph.object_instances:
            thing = instance.object
            if instance.show_self and not thing.hide_render:
                place = instance.matrix_world.copy()
                if thing.type == "LIGHT":
                    bodies += self.lamp(thing, place)
                elif thing.type in {"MESH", "CURVE", "SURFACE", "META", "FONT"}:
                    bodies += self.mesh(thing, place)
                elif thing.type in {"VOLUME", "GPENCIL", "CURVES", "POINTCLOUD"}:
                    warn(f"'{thing.name}': objects of the kind {thing.type} are left out")
                if any(system.settings.type == "HAIR" for system in thing.particle_systems):
                    warn(f"'{thing.name}': hair is left out")
        self.lines += [line for lines in self.materials.values() for line in lines[1]]
        self.lines += bodies + ["</scene>", ""]
        (self.folder / "scene.xml").write_text("\n".join(self.lines), encoding="utf-8")

    # ---- camera ----
    def camera(self):
        thing = self.scene.camera
        if thing is None:
            sys.exit("export.py: error: the scene has no camera")
        data, render = thing.data, self.scene.render
        width = render.resolution_x * render.resolution_percentage // 100
        height = render.resolution_y * render.resolution_percentage // 100
        if render.pixel_aspect_x != render.pixel_aspect_y:
            warn("pixels that are not square are taken as square")
        if render.use_motion_blur:
            warn("motion blur is left out")
        # Candela's cameras look along +z with x to the left, Blender's along -z with x to the right.
        place = thing.matrix_world.normalized() @ Matrix.Rotation(math.pi, 4, "Y")
        kind, extra = "perspective", []
        wide = width >= height
        fit = data.sensor_fit if data.sensor_fit != "AUTO" else ("HORIZONTAL" if wide else "VERTICAL")
        if data.type == "ORTHO":
            kind = "orthographic"
            # The film is 2 units wide (and 2 height/width high) in the camera's frame.
            scale = data.ortho_scale / 2 if fit == "HORIZONTAL" else data.ortho_scale / 2 * width / height
            place = place @ Matrix.Diagonal((scale, scale, 1, 1))
        elif data.type == "PERSP":
            extra = [("string", "fov_axis", "x" if fit == "HORIZONTAL" else "y"), ("float", "fov", number(math.degrees(data.angle)))]
        else:
            sys.exit(f"export.py: error: a camera of the kind {data.type} has no counterpart")
        if data.shift_x or data.shift_y:
            longer = width if fit == "HORIZONTAL" else height  # a shift counts in this side
            extra += [("float", "principal_point_offset_x", number(data.shift_x * longer / width)),
                      ("float", "principal_point_offset_y", number(-data.shift_y * longer / height))]
        if data.dof.use_dof and data.type == "PERSP":
            kind = "thinlens"
            focus = data.dof.focus_distance
            if data.dof.focus_object:
                focus = -(thing.matrix_world.inverted() @ data.dof.focus_object.matrix_world.translation).z
            extra += [("float", "aperture_radius", number(data.lens / 1000 / (2 * data.dof.aperture_fstop))),
                      ("float", "focus_distance", number(focus))]
        spp = self.spp or getattr(getattr(self.scene, "cycles", None), "samples", 0) or 64
        self.lines += [f'  <sensor type="{kind}">', f"    {matrix(place)}",
                       *(f'    <{tag} name="{name}" value="{value}"/>' for tag, name, value in extra),
                       f'    <float name="near_clip" value="{number(data.clip_start)}"/>',
                       f'    <float name="far_clip" value="{number(data.clip_end)}"/>',
                       '    <film type="hdrfilm">', f'      <integer name="width" value="{width}"/>',
                       f'      <integer name="height" value="{height}"/>', "    </film>",
                       f'    <sampler type="independent"><integer name="sample_count" value="{spp}"/></sampler>', "  </sensor>"]

    # ---- lamps ----
    def world(self):
        world = self.scene.world
        if world is None:
            return
        color, strength, picture = world.color, 1.0, None
        if world.use_nodes:
            found = [node for node in world.node_tree.nodes if node.type == "BACKGROUND"]
            if len(found) != 1:
                warn("the world is left out: it is not one Background")
                return
            strength = found[0].inputs["Strength"].default_value
            color = found[0].inputs["Color"].default_value[:3]
            picture = source_of(found[0].inputs["Color"])
        if picture is not None and picture.type == "TEX_ENVIRONMENT" and picture.image and picture.projection == "EQUIRECTANGULAR":
            if picture.inputs["Vector"].is_linked:
                warn("the world's mapping is left out: its environment is not turned")
            turn = Matrix(((0, 0, 1, 0), (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
            self.lines += ['  <emitter type="envmap">', f'    <string name="filename" value={quoteattr(self.image(picture.image))}/>',
                           f'    <float name="scale" value="{number(strength)}"/>', f"    {matrix(turn)}", "  </emitter>"]
            return
        if picture is not None:
            warn("the world's color by nodes is left out: only an equirectangular environment texture is taken")
        if strength > 0 and max(color) > 0:
            self.lines.append(f'  <emitter type="constant"><rgb name="radiance" value="{numbers(c * strength for c in color)}"/></emitter>')

    def lamp(self, thing, place):
        data = thing.data
        if data.use_nodes and any(node.type not in {"OUTPUT_LIGHT", "EMISSION"} for node in data.node_tree.nodes):
            warn(f"lamp '{thing.name}': its nodes are left out")
        power = [c * data.energy for c in data.color]
        # As Cycles has it: watts to intensity or radiance.
        if data.type == "SUN":
            if data.angle > math.radians(1):
                warn(f"lamp '{thing.name}': a sun has no size, its shadows are sharp")
            direction = place.to_3x3() @ Matrix.Identity(3).col[2]
            return [f'  <emitter type="directional"><vector name="direction" value="{numbers(-direction)}"/>'
                    f'<rgb name="irradiance" value="{numbers(power)}"/></emitter>']
        if data.type == "AREA":
            size_x, size_y = data.size, data.size_y if data.shape in {"RECTANGLE", "ELLIPSE"} else data.size
            if data.shape == "ELLIPSE":
                warn(f"lamp '{thing.name}': an ellipse becomes a rectangle of its area")
                size_x, size_y = size_x * math.sqrt(math.pi) / 2, size_y * math.sqrt(math.pi) / 2
            round_lamp = data.shape == "DISK"
            shape = "disk" if round_lamp else "rectangle"
            scale = place.to_scale()
            area = size_x * size_y * abs(scale.x * scale.y) * (math.pi / 4 if round_lamp else 1)
            # A lamp shines along -z, a shape along +z.
            frame = place @ Matrix.Rotation(math.pi, 4, "X") @ Matrix.Diagonal((size_x / 2, size_y / 2, 1, 1))
            return [f'  <shape type="{shape}">', f"    {matrix(frame)}", *self.black(),
                    f'    <emitter type="area"><rgb name="radiance" value="{numbers(p / (4 * area) for p in power)}"/></emitter>', "  </shape>"]
        center = place.translation
        intensity = [p / (4 * math.pi) for p in power]
        radius = data.shadow_soft_size
        if data.type == "POINT" and radius > 0:
            return ['  <shape type="sphere">', f'    <point name="center" value="{numbers(center)}"/>',
                    f'    <float name="radius" value="{number(radius)}"/>', *self.black(),
                    f'    <emitter type="area"><rgb name="radiance" value="{numbers(i / (math.pi * radius**2) for i in intensity)}"/></emitter>',
                    "  </shape>"]
        if data.type == "POINT":
            return [f'  <emitter type="point"><point name="position" value="{numbers(center)}"/>'
                    f'<rgb name="intensity" value="{numbers(intensity)}"/></emitter>']
        if radius > 0:
            warn(f"lamp '{thing.name}': a spot has no size, its shadows are sharp")
        half = min(data.spot_size / 2, WIDEST_SPOT)
        if data.spot_size / 2 > WIDEST_SPOT:
            warn(f"lamp '{thing.name}': a spot is at most {number(2 * math.degrees(WIDEST_SPOT))} degrees wide")
        frame = place.normalized() @ Matrix.Rotation(math.pi, 4, "Y")
        lines = ['  <emitter type="spot">', f"    {matrix(frame)}", f'    <rgb name="intensity" value="{numbers(intensity)}"/>',
                 *(f'    <float name="{name}" value="{number(math.degrees(half))}"/>' for name in ("cutoff_angle", "beam_width"))]
        if FADING_SPOTS or data.spot_blend > 0:
            lines.append(f'    <texture type="bitmap" name="texture"><string name="filename" value="{self.spot(half, data)}"/>'
                         '<boolean name="raw" value="true"/></texture>')
        return [*lines, "  </emitter>"]

    def spot(self, half, data):
        """The picture by which a spot fades towards its edge: of the square around the cone's circle, on a plane across its axis."""
        key = ("spot", half, data.spot_size, data.spot_blend)
        if key not in self.textures:
            self.textures[key] = f"textures/{self.name('spot')}.exr"
            place = (np.arange(SPOT_PIXELS) + 0.5) / SPOT_PIXELS * 2 - 1
            cosine = 1 / np.sqrt(1 + (place[:, None] ** 2 + place[None, :] ** 2) * math.tan(half) ** 2)
            light = cosine if FADING_SPOTS else np.ones_like(cosine)
            if data.spot_blend > 0:
                edge = math.cos(data.spot_size / 2)
                inside = np.clip((cosine - edge) / ((1 - edge) * data.spot_blend), 0, 1)
                light = light * inside * inside * (3 - 2 * inside)
            pixels = np.ones((SPOT_PIXELS, SPOT_PIXELS, 4), np.float32)
            pixels[:, :, :3] = light[:, :, None]
            image = bpy.data.images.new("spot", SPOT_PIXELS, SPOT_PIXELS, float_buffer=True)
            image.colorspace_settings.name = "Non-Color"
            image.pixels.foreach_set(pixels.ravel())
            image.filepath_raw, image.file_format = str(self.folder / self.textures[key]), "OPEN_EXR"
            image.save()
            bpy.data.images.remove(image)
        return self.textures[key]

    @staticmethod
    def black():
        return ['    <bsdf type="diffuse"><rgb name="reflectance" value="0, 0, 0"/></bsdf>']

    # ---- meshes ----
    def mesh(self, thing, place):
        mesh = thing.to_mesh()
        if mesh is None or not mesh.polygons:
            return []
        mesh.calc_loop_triangles()
        mesh.calc_normals_split()
        count = len(mesh.loop_triangles)
        loops, slots = np.empty(3 * count, np.int32), np.empty(count, np.int32)
        mesh.loop_triangles.foreach_get("loops", loops)
        mesh.loop_triangles.foreach_get("material_index", slots)
        at, normals = np.empty(len(mesh.loops), np.int32), np.empty(3 * len(mesh.loops), np.float32)
        mesh.loops.foreach_get("vertex_index", at)
        mesh.loops.foreach_get("normal", normals)
        points = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", points)
        uv = np.zeros((len(mesh.loops), 2), np.float32)
        if mesh.uv_layers.active:
            flat = np.empty(2 * len(mesh.loops), np.float32)
            mesh.uv_layers.active.data.foreach_get("uv", flat)
            uv = flat.reshape(-1, 2)
            uv[:, 1] = 1 - uv[:, 1]  # v counts from the top of an image
        frame = np.array(place, np.float64)
        points = points.reshape(-1, 3) @ frame[:3, :3].T + frame[:3, 3]
        turned = normals.reshape(-1, 3) @ np.linalg.inv(frame[:3, :3])
        turned /= np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-30)
        corners = np.hstack((points[at], turned, uv)).astype("<f4")
        triangles = loops.reshape(-1, 3)
        if np.linalg.det(frame[:3, :3]) < 0:
            triangles = triangles[:, ::-1]
        lines = []
        for slot in np.unique(slots):
            used = triangles[slots == slot]
            vertices, index = np.unique(corners[used.ravel()], axis=0, return_inverse=True)
            material = thing.material_slots[slot].material if slot < len(thing.material_slots) else None
            name = self.name(thing.name)
            self.ply(self.folder / "meshes" / f"{name}.ply", vertices, index.reshape(-1, 3))
            reference, radiance = self.material(material)
            lines += [f'  <shape type="ply" id="{name}">', f'    <string name="filename" value="meshes/{name}.ply"/>',
                      f'    <ref name="bsdf" id="{reference}"/>']
            if radiance:
                lines.append(f'    <emitter type="area"><rgb name="radiance" value="{numbers(radiance)}"/></emitter>')
            lines.append("  </shape>")
        thing.to_mesh_clear()
        return lines

    @staticmethod
    def ply(path, vertices, triangles):
        names = ("x", "y", "z", "nx", "ny", "nz", "u", "v")
        rows = np.empty(len(triangles), [("count", "u1"), ("index", "<i4", 3)])
        rows["count"], rows["index"] = 3, triangles
        with open(path, "wb") as file:
            file.write("\n".join(["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}",
                                  *(f"property float {name}" for name in names), f"element face {len(triangles)}",
                                  "property list uchar int vertex_indices", "end_header", ""]).encode())
            file.write(vertices.astype("<f4").tobytes())
            file.write(rows.tobytes())

    # ---- materials ----
    def material(self, material):
        """The id of its bsdf, and the radiance of its surface or None."""
        key = material.name if material else ""
        if key not in self.materials:
            name = self.name("material_" + (key or "none"))
            lines, radiance = self.bsdf(material)
            self.materials[key] = (name, [f'  <bsdf type="{lines[0]}" id="{name}">', *lines[1:], "  </bsdf>"], radiance)
        return self.materials[key][0], self.materials[key][2]

    def bsdf(self, material):
        plain = ["twosided", '    <bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.8, 0.8"/></bsdf>']
        if material is None:
            return plain, None
        if not material.use_nodes:
            plain[1] = f'    <bsdf type="diffuse"><rgb name="reflectance" value="{numbers(material.diffuse_color[:3])}"/></bsdf>'
            return plain, None
        outputs = [node for node in material.node_tree.nodes if node.type == "OUTPUT_MATERIAL" and node.is_active_output]
        node = source_of(outputs[0].inputs["Surface"]) if outputs else None
        if outputs and (outputs[0].inputs["Volume"].is_linked or outputs[0].inputs["Displacement"].is_linked):
            warn(f"material '{material.name}': volume and displacement are left out")
        if node is not None and node.type == "EMISSION":
            color = self.constant(node.inputs["Color"], material.name)[:3]
            strength = self.constant(node.inputs["Strength"], material.name)
            return ["diffuse", '    <rgb name="reflectance" value="0, 0, 0"/>'], [c * strength for c in color]
        if node is None or node.type != "BSDF_PRINCIPLED":
            warn(f"material '{material.name}': only one Principled BSDF or Emission is taken; it becomes gray")
            return plain, None
        return self.principled(material, node)

    def principled(self, material, node):
        inputs = {socket.name: socket for socket in node.inputs}
        value = lambda name: self.constant(inputs[name], material.name)
        out = [self.color(inputs["Base Color"], "base_color", material.name), self.scalar(inputs["Roughness"], "roughness", material.name),
               self.scalar(inputs["Metallic"], "metallic", material.name)]
        transmission = value("Transmission")
        plain = {"anisotropic": "Anisotropic", "spec_tint": "Specular Tint", "sheen": "Sheen", "sheen_tint": "Sheen Tint", "clearcoat": "Clearcoat"}
        for ours, theirs in plain.items():
            if value(theirs) > 0 and not (ours == "sheen_tint" and value("Sheen") == 0):
                out.append(f'<float name="{ours}" value="{number(min(1, value(theirs)))}"/>')
        if value("Clearcoat") > 0:
            out.append(f'<float name="clearcoat_gloss" value="{number(min(1, max(0, 1 - value("Clearcoat Roughness"))))}"/>')
        if transmission > 0:
            out += [f'<float name="spec_trans" value="{number(transmission)}"/>', f'<float name="eta" value="{number(value("IOR"))}"/>']
        else:
            out.append(f'<float name="specular" value="{number(min(1, value("Specular")))}"/>')
        if value("Subsurface") > 0:
            warn(f"material '{material.name}': subsurface scattering is left out")
        if inputs["Normal"].is_linked:
            warn(f"material '{material.name}': its normal or bump map is left out")
        lines = [f"      {line}" for line in out]
        if transmission > 0:
            lines = ["principled", *lines]
        else:
            lines = ["twosided", '    <bsdf type="principled">', *lines, "    </bsdf>"]
        if inputs["Alpha"].is_linked:
            warn(f"material '{material.name}': its alpha by nodes is left out")
        elif value("Alpha") < 1:
            inner = [f'    <bsdf type="{lines[0]}">', *lines[1:], "    </bsdf>"]
            lines = ["mask", f'    <float name="opacity" value="{number(value("Alpha"))}"/>', *inner]
        radiance = [c * value("Emission Strength") for c in value("Emission")[:3]]
        return lines, radiance if max(radiance) > 0 else None

    def constant(self, socket, material):
        if socket.is_linked:
            warn(f"material '{material}': nodes of '{socket.name}' are left out, its plain value is taken")
        return socket.default_value

    def texture(self, socket, material):
        """The file of the image that is linked, or None."""
        if not socket.is_linked:
            return None
        node = source_of(socket)
        if node is not None and node.type == "TEX_IMAGE" and node.image:
            if node.inputs["Vector"].is_linked and source_of(node.inputs["Vector"]).type != "TEX_COORD" and \
                    source_of(node.inputs["Vector"]).type != "UVMAP":
                warn(f"material '{material}': the mapping of '{node.image.name}' is left out")
            return node.image
        warn(f"material '{material}': nodes of '{socket.name}' are left out, its plain value is taken")
        return None

    def color(self, socket, name, material):
        image = self.texture(socket, material)
        if image:
            return f'<texture type="bitmap" name="{name}"><string name="filename" value={quoteattr(self.image(image))}/></texture>'
        return f'<rgb name="{name}" value="{numbers(min(1, max(0, c)) for c in socket.default_value[:3])}"/>'

    def scalar(self, socket, name, material):
        image = self.texture(socket, material)
        if image:
            return (f'<texture type="bitmap" name="{name}"><string name="filename" value={quoteattr(self.image(image))}/>'
                    '<boolean name="raw" value="true"/></texture>')
        return f'<float name="{name}" value="{number(min(1, max(0, socket.default_value)))}"/>'

    def image(self, image):
        """Copies the image, or writes one that only Blender has; its name from the scene's folder."""
        if image.name not in self.textures:
            source = Path(bpy.path.abspath(image.filepath)) if image.filepath else None
            if image.source == "FILE" and not image.packed_file and source and source.is_file():
                target = f"textures/{self.name(source.stem)}{source.suffix.lower()}"
                shutil.copyfile(source, self.folder / target)
            else:
                target = f"textures/{self.name(Path(image.name).stem)}.{'exr' if image.is_float else 'png'}"
                image.file_format = "OPEN_EXR" if image.is_float else "PNG"
                copy = image.copy()
                copy.filepath_raw = str(self.folder / target)
                copy.file_format = image.file_format
                copy.save()
                bpy.data.images.remove(copy)
            self.textures[image.name] = target
        return self.textures[image.name]


def source_of(socket):
    """The node that is linked to the socket, reroutes passed over, or None."""
    while socket.is_linked:
        node = socket.links[0].from_node
        if node.type != "REROUTE":
            return node
        socket = node.inputs[0]
    return None


def main():
    given = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else []
    parser = argparse.ArgumentParser(prog="export.py", description="Write the scene for Candela.")
    parser.add_argument("folder")
    parser.add_argument("--frame", type=int)
    parser.add_argument("--spp", type=int)
    options = parser.parse_args(given)
    if options.frame is not None:
        bpy.context.scene.frame_set(options.frame)
    Export(options.folder, options.spp).write()
    print(f"export.py: wrote {os.path.join(options.folder, 'scene.xml')}")


if __name__ == "__main__":
    # Blender goes on after an exception, with exit code 0.
    try:
        main()
    except Exception as problem:  # pylint: disable=broad-except
        import traceback
        traceback.print_exc()
        print(f"export.py: error: {problem}", file=sys.stderr)
        os._exit(1)
