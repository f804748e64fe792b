// Parts of a compiled scene, and their construction from a description.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/description/object_names.h"
#include "common/description/reading_budget.h"
#include "common/edits/selection.h"
#include "common/letters/alphabet.h"
#include "worker/scene/accel.h"
#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/bsdfs/edited.h"
#include "worker/scene/edits/edit_request.h"
#include "worker/scene/emitters/lights.h"
#include "worker/scene/features.h"
#include "worker/scene/irradiance_meter.h"
#include "worker/scene/media/media.h"
#include "worker/scene/objects.h"
#include "worker/scene/placement.h"
#include "worker/scene/sensors/sensor.h"
#include "worker/scene/shapes/geometry.h"
#include "worker/scene/textures/texture.h"
#include "worker/scene/transform.h"

namespace candela::scene {

struct SceneData {
  std::unique_ptr<TextureStore> textures;
  Geometry geometry;
  std::vector<Bsdf> bsdfs;
  Lights lights{geometry};
  Media media;
  std::uint32_t camera_medium = kNone;
  std::vector<std::uint32_t> emitter_media;  // by emitter
  std::vector<bool> passthrough;             // of each bsdf: some light passes straight on
  std::unique_ptr<Accel> accel;
  Sensor sensor;
  std::optional<IrradianceMeter> meter;  // in the place of the sensor
  SceneFeatures features;
  SceneObjects objects;
  SceneEdits edits;
};

// Fills SceneData: shapes first, then finish_geometry, emitters, finish_features.
class SceneBuilder {
 public:
  // Both must outlive this; data.textures is there already. `parameterized`: as Scene::Options has it.
  SceneBuilder(const description::FileSource& files, SceneData& data, bool parameterized = false)
      : files_(files),
        parameterized_(parameterized),
        textures_(*data.textures),
        geometry_(data.geometry),
        bsdfs_(data.bsdfs),
        lights_(data.lights),
        media_(data.media),
        emitter_media_(data.emitter_media),
        features_(data.features),
        objects_(data.objects),
        edits_(data.edits) {}

  // The scene's objects are to have names; call it before shapes().
  void name_objects(const description::Object& scene) { names_.emplace(scene); }
  // Names the meter's shape; call it before shapes(). measured() is then its index, or kNone if it is in a
  // shapegroup.
  void measure(const description::Object& shape) { measured_object_ = &shape; }
  std::uint32_t measured() const { return measured_; }
  const std::optional<Rectangle>& measured_rectangle() const { return measured_rectangle_; }

  Result<void> shapes(const description::Object& scene);
  // Point that is moved to the origin, if the scene lies far from the origin with the camera, or one of its
  // shapegroups does in its own space. Call it after shapes().
  std::optional<Placement> far_placement(const std::optional<Vec3d>& camera) const;
  // Puts edits around the bsdfs of the shapes that they select. The objects have names. Call it after
  // shapes(), and add no bsdf later.
  Result<void> edit(const EditRequest& request);
  // The same for lamps. Call it after the last emitter, before Lights::finish().
  Result<void> edit_lamps(const EditRequest& request);
  // The same for media. If an edit selects by more of the path than its vertex edit() did nothing, and this
  // makes objects().path_edits. Call it last.
  Result<void> finish_edits(const EditRequest& request);
  // with_triangles: rays will be traced; without, the records of triangles are made if a lamp needs them.
  Result<void> finish_geometry(bool with_triangles);
  // Makes the records of triangles, unless they are there already.
  void make_triangles();
  Result<void> emitter(const description::Object& object);
  void finish_features();
  // Names the media; call it last.
  void finish_objects();

 private:
  struct AreaEmitter {
    std::uint32_t shape;
    std::optional<Rectangle> rectangle;
    description::ObjectPtr object;
  };

  // Inputs that the textures at and below an object read.
  struct TextureUse {
    bool uv = false;                      // or an anisotropic lobe, whose axes follow (u, v)
    bool wireframe = false;               // edges of triangles
    bool place = false;                   // more of a surface than (u, v)
    std::vector<std::string> attributes;  // of meshes, each once
  };
  // For a shape: without the shapes that it holds.
  TextureUse texture_use(const description::Object& object);
  // For an object that the scene keeps: each is walked once, however often it is referred to.
  const TextureUse& texture_use_of_part(const description::Object& object);

  // Reads the meshes whose attributes textures look at, so that the textures' bounds are known.
  Result<void> read_attributes(const description::Object& object);
  // With its group if it is the first of it.
  Result<void> instance(const description::Object& object);
  Result<void> add_instance(const description::Object& object, std::uint32_t group);
  Result<void> count(const description::Object& object, std::uint64_t bytes, std::string_view what) {
    return files_.budget().charge(bytes, object.where, what);
  }
  // A round shape whose to_world stretches it: an instance of its own.
  Result<void> stretched(const description::Object& object);
  // group: the shapegroup that holds it, or null.
  Result<void> add_shape(const description::Object& object, const description::Object* group);
  // The parts of an OBJ file that have bsdfs of their own.
  Result<void> add_parts(const description::Object& object, const description::Object* group);
  // part: its bsdf, if the parts of the object have bsdfs of their own.
  Result<void> add_built(const description::Object& object, Shape shape, ShapeRecord record,
                         const description::Object* group, const description::Object* part = nullptr);
  // Tells that a mesh without area is not in the scene. An error if somebody measures on it.
  Result<void> leave_out(const description::Object& object, const Shape& shape);
  // kNone if nothing of the group has an area.
  Result<std::uint32_t> group_of(const description::ObjectPtr& object);
  bool is_stretched_surface(const description::Object& shape) const;
  Result<std::uint32_t> bsdf_of(const description::Object& shape, bool emits);
  // `given`: null where the shape has none.
  Result<std::uint32_t> bsdf_of(const description::Object& shape, bool emits,
                                const description::ObjectPtr& given);
  // Scaled to its `power`, if it has one.
  Result<ColorTexture> radiance_of(const AreaEmitter& area);
  void count_bsdf(const Bsdf& bsdf);
  // The index of the object that is met in this way and has these names.
  std::uint32_t object_named(letters::ObjectUse use, std::vector<std::string> names);
  void name_lamp(const description::Object& emitter);

  const description::FileSource& files_;
  const bool parameterized_;
  TextureStore& textures_;
  Geometry& geometry_;
  std::vector<Bsdf>& bsdfs_;
  RoughTransmittances coats_;
  Lights& lights_;
  Media& media_;
  std::vector<std::uint32_t>& emitter_media_;
  SceneFeatures& features_;
  SceneObjects& objects_;
  SceneEdits& edits_;
  Result<std::vector<edits::Selection>> selections_of(const EditRequest& request) const;
  Result<void> edit_media(const EditRequest& request, const std::vector<edits::Selection>& selections);
  Result<void> edit_by_path(const EditRequest& request);
  Result<void> check_first_surfaces(const EditRequest& request) const;

  bool edited_ = false;  // edit() found no edits that select by more of the path
  // By edit: the shapes, lamps and media that it selects.
  struct Selected {
    std::size_t shapes = 0, lamps = 0, media = 0;
  };
  std::vector<Selected> selected_;
  std::optional<description::ObjectNamesOfScene> names_;  // if somebody asks for them
  std::map<std::pair<letters::ObjectUse, std::vector<std::string>>, std::uint32_t> object_of_names_;
  std::vector<description::MatteShape> matte_shapes_;  // by the index of the shape, if there are names
  std::map<const description::Object*, std::uint32_t> bsdf_of_object_;
  std::uint32_t default_bsdf_ = kNone, black_bsdf_ = kNone, null_bsdf_ = kNone;
  std::vector<AreaEmitter> area_emitters_;
  std::map<const description::Object*, std::uint32_t> group_of_object_;
  std::map<const description::Object*, Shape> read_shapes_;
  std::set<const description::Object*> read_groups_;
  std::map<const description::Object*, TextureUse> texture_uses_;
  std::vector<ShapePlace> shape_places_;  // by shape
  Bounds left_out_;                       // of meshes without area
  std::vector<std::string> warnings_;     // of shapes; said when the scene stays where it is
  bool triangles_made_ = false;
  const description::Object* measured_object_ = nullptr;
  std::uint32_t measured_ = kNone;
  std::optional<Rectangle> measured_rectangle_;
  bool all_delta_ = true;
};

}  // namespace candela::scene
