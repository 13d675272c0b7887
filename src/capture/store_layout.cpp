#include "doppel/capture/store_layout.h"

#include <nlohmann/json.hpp>

#include "doppel/core/error.h"

namespace doppel {

namespace {

using nlohmann::json;

constexpr char kDescription[] = "meta/description", kComplete[] = "meta/complete";

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
  camera.width = node.at("width").get<int>();
  camera.height = node.at("height").get<int>();
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
  landmark.joint = node.at("joint").get<int>();
  for (int i = 0; i < 3; ++i) landmark.position[i] = node.at("position").at(i).get<double>();
  return landmark;
}

StoreLayout from_json(const json& document, const FileLocation& where) {
  const int version = document.at("doppel_store").get<int>();
  if (version != kStoreVersion)
    fail_at(where,
            "the store has version {}, this program reads version {}; prepare the capture again with --overwrite",
            version, kStoreVersion);
  StoreLayout layout;
  layout.settings = document.at("settings").get<std::string>();
  layout.num_dofs = document.at("num_dofs").get<int>();
  layout.mask_size = document.at("mask_size").get<int>();
  layout.image_size = document.at("image_size").get<int>();
  for (const json& node : document.at("cameras")) {
    layout.cameras.emplace_back(camera_from_json(node));
    layout.file_index.push_back(node.at("index").get<int>());
  }
  // Stores of versions without keypoints do not have this list.
  for (const json& node : document.value("landmarks", json::array()))
    layout.landmarks.push_back(landmark_from_json(node));
  return layout;
}

}  // namespace

StoreLayout read_store_layout(const Store& store) {
  const FileLocation where{(store.folder() / "data.mdb").string(), 0};
  const auto text = store.get(kDescription);
  if (!text) fail_at(where, "the store has no description; prepare the capture again with --overwrite");
  try {
    StoreLayout layout = from_json(json::parse(*text), where);
    layout.complete = store.has(kComplete);
    return layout;
  } catch (const json::exception& e) {
    fail_at(where, "the store's description cannot be read ({}); prepare the capture again with --overwrite", e.what());
  }
}

void write_store_layout(Store& store, const StoreLayout& layout) {
  json document{{"doppel_store", kStoreVersion}, {"settings", layout.settings},     {"num_dofs", layout.num_dofs},
                {"mask_size", layout.mask_size}, {"image_size", layout.image_size}, {"cameras", json::array()}};
  for (std::size_t i = 0; i < layout.cameras.size(); ++i)
    document["cameras"].push_back(to_json(layout.cameras[i], layout.file_index.at(i)));
  if (!layout.landmarks.empty()) document["landmarks"] = json::array();
  for (const Marker& landmark : layout.landmarks) document["landmarks"].push_back(to_json(landmark));
  store.put({{kDescription, document.dump()}});
}

void mark_complete(Store& store) { store.put({{kComplete, "1"}}); }

}  // namespace doppel
