#include "doppel/data/prepare/store_layout.h"

#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>

#include "doppel/core/crc32c.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

using nlohmann::json;

constexpr char kDescription[] = "meta/description", kComplete[] = "meta/complete";

/// A whole number of the description; -1, which check_layout refuses, for anything else.
int whole_number(const json& node) {
  if (!node.is_number_integer()) return -1;
  const auto value = node.get<std::int64_t>();
  return value >= 0 && value <= std::numeric_limits<int>::max() ? static_cast<int>(value) : -1;
}

json to_json(const Camera& camera, int index) {
  std::vector<double> k, r;
  for (int i = 0; i < 9; ++i) {
    k.push_back(camera.K(i / 3, i % 3));
    r.push_back(camera.R(i / 3, i % 3));
  }
  return {{"name", camera.name},
          {"index", index},
          {"width", camera.width},
          {"height", camera.height},
          {"K", k},
          {"R", r},
          {"t", {camera.t.x(), camera.t.y(), camera.t.z()}}};
}

Camera camera_from_json(const json& node) {
  Camera camera;
  camera.name = node.at("name").get<std::string>();
  camera.width = whole_number(node.at("width"));
  camera.height = whole_number(node.at("height"));
  for (int i = 0; i < 9; ++i) {
    camera.K(i / 3, i % 3) = node.at("K").at(i).get<double>();
    camera.R(i / 3, i % 3) = node.at("R").at(i).get<double>();
  }
  for (int i = 0; i < 3; ++i) camera.t[i] = node.at("t").at(i).get<double>();
  return camera;
}

json to_json(const Marker& landmark) {
  const Eigen::Vector3d& p = landmark.position;
  return {{"name", landmark.name}, {"joint", landmark.joint}, {"position", {p.x(), p.y(), p.z()}}};
}

Marker landmark_from_json(const json& node) {
  Marker landmark;
  landmark.name = node.at("name").get<std::string>();
  landmark.joint = whole_number(node.at("joint"));
  for (int i = 0; i < 3; ++i) landmark.position[i] = node.at("position").at(i).get<double>();
  return landmark;
}

StoreLayout from_json(const json& document, const FileLocation& where) {
  const int version = whole_number(document.at("doppel_store"));
  if (version != kStoreVersion)
    fail_at(where,
            "the store has version {}, this program reads version {}; prepare the capture again with --overwrite",
            version, kStoreVersion);
  StoreLayout layout;
  layout.settings = document.at("settings").get<std::string>();
  layout.num_dofs = whole_number(document.at("num_dofs"));
  layout.mask_size = whole_number(document.at("mask_size"));
  layout.image_size = whole_number(document.at("image_size"));
  for (const json& node : document.at("cameras")) {
    layout.cameras.emplace_back(camera_from_json(node));
    layout.file_index.push_back(whole_number(node.at("index")));
  }
  // Stores of versions without keypoints do not have this list.
  for (const json& node : document.value("landmarks", json::array()))
    layout.landmarks.push_back(landmark_from_json(node));
  layout.skeleton = document.value("skeleton", "");
  return layout;
}

/// What other code indexes with and allocates.
void check_layout(const StoreLayout& layout, const FileLocation& where) {
  const auto bad_side = [](int side) { return side < 1 || side > kMaxImageSide; };
  bool bad = layout.num_dofs < 1 || bad_side(layout.mask_size) || bad_side(layout.image_size) || layout.cameras.empty();
  for (const PinholeCamera& camera : layout.cameras) bad = bad || !camera.faults().empty();
  for (const int index : layout.file_index) bad = bad || index < 0;
  for (const Marker& landmark : layout.landmarks) bad = bad || landmark.joint < 0 || !landmark.position.allFinite();
  if (bad) fail_at(where, "the store's description has impossible sizes; prepare the capture again with --overwrite");
}

}  // namespace

std::string fingerprint_of(const Skeleton& skeleton) {
  std::string text;
  for (const Joint& joint : skeleton.joints)
    text +=
        fmt::format("{} {} {}\n", joint.name, joint.type == Joint::Type::prismatic ? "slides" : "turns", joint.parent);
  for (const Dof& dof : skeleton.dofs) {
    text += dof.name;
    for (const Dof::Drive& drive : dof.joints) text += fmt::format(" {} {}", drive.joint, drive.weight);
    text += "\n";
  }
  return fmt::format("{:08x}", crc32c(text.data(), text.size()));
}

StoreLayout read_store_layout(const Store& store) {
  const FileLocation where{(store.folder() / "data.mdb").string(), 0};
  const auto text = store.get(kDescription);
  if (!text) fail_at(where, "the store has no description; prepare the capture again with --overwrite");
  try {
    StoreLayout layout = from_json(json::parse(*text), where);
    check_layout(layout, where);
    layout.complete = store.has(kComplete);
    return layout;
  } catch (const json::exception& e) {
    fail_at(where, "the store's description cannot be read ({}); prepare the capture again with --overwrite", e.what());
  }
}

void write_store_layout(Store& store, const StoreLayout& layout) {
  json document{{"doppel_store", kStoreVersion}, {"settings", layout.settings},     {"num_dofs", layout.num_dofs},
                {"mask_size", layout.mask_size}, {"image_size", layout.image_size}, {"cameras", json::array()},
                {"skeleton", layout.skeleton}};
  for (std::size_t i = 0; i < layout.cameras.size(); ++i)
    document["cameras"].push_back(to_json(layout.cameras[i], layout.file_index.at(i)));
  if (!layout.landmarks.empty()) document["landmarks"] = json::array();
  for (const Marker& landmark : layout.landmarks) document["landmarks"].push_back(to_json(landmark));
  store.put({{kDescription, document.dump(-1, ' ', false, json::error_handler_t::replace)}});
}

void mark_complete(Store& store) { store.put({{kComplete, "1"}}); }

}  // namespace doppel
