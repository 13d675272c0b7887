#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "doppel/io/figure_export/fbx_records.h"

/// FBX files, written as the format says: records with values, as text; `fbx_binary` writes them as bytes. Independent
/// of the reader.
namespace doppel::support {

inline FbxNode fbx_property70(const std::string& name, std::vector<double> numbers) {
  FbxNode property{"P", {name, std::string("type"), std::string(), std::string("A")}, {}};
  for (const double number : numbers) property.values.emplace_back(number);
  return property;
}

inline FbxNode fbx_object(const std::string& kind, std::int64_t id, const std::string& name, const std::string& type,
                          std::vector<FbxNode> children) {
  return {kind, {id, fbx_object_name(name, kind), type}, std::move(children)};
}

template <typename List>
std::string fbx_list_text(const List& list) {
  return fmt::format("*{} {{ a: {} }}", list.size(), fmt::join(list, ","));
}

/// `name\0\1Kind` is written as `Kind::name`.
inline std::string fbx_word_text(const std::string& word) {
  const std::size_t mark = word.find(std::string("\0\1", 2));
  if (mark == std::string::npos) return '"' + word + '"';
  return '"' + word.substr(mark + 2) + "::" + word.substr(0, mark) + '"';
}

/// A value as text; raw bytes have no text here.
struct FbxValueText {
  std::string operator()(const std::string& word) const { return fbx_word_text(word); }
  std::string operator()(const FbxBytes&) const { return "\"\""; }
  template <typename T>
  std::string operator()(const std::vector<T>& list) const {
    return fbx_list_text(list);
  }
  template <typename T>
  std::string operator()(T number) const {
    return fmt::format("{}", number);
  }
};

inline std::string fbx_record_text(const FbxNode& node, const std::string& indent = "") {
  std::string text = indent + node.name + ":";
  for (std::size_t i = 0; i < node.values.size(); ++i)
    text += (i == 0 ? " " : ", ") + std::visit(FbxValueText(), node.values[i]);
  if (node.children.empty()) return text + "\n";
  text += " {\n";
  for (const FbxNode& child : node.children) text += fbx_record_text(child, indent + "  ");
  return text + indent + "}\n";
}

/// The text form. @param root its children are the records of the file
inline std::string fbx_text(const FbxNode& root) {
  std::string text = "; FBX 7.4.0 project file\n";
  for (const FbxNode& child : root.children) text += fbx_record_text(child);
  return text;
}

/// An arm of two joints as in bending_arm (gltf_writer.h), in centimetres: 6 vertices, a quad and a triangle with UVs,
/// a skin, one material, and the animation `bend` of `lower` by 90 degrees about z within a second.
inline FbxNode fbx_arm() {
  const std::vector<double> identity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  std::vector<double> raised = identity, lowered = identity;
  raised[13] = 100;
  lowered[13] = -100;
  const std::int64_t second = 46186158000;
  const auto cluster = [](std::int64_t id, std::vector<std::int32_t> vertices, std::vector<double> weights,
                          std::vector<double> own, std::vector<double> link) {
    return fbx_object("Deformer", id, "cluster", "Cluster",
                      {{"Indexes", {std::move(vertices)}, {}},
                       {"Weights", {std::move(weights)}, {}},
                       {"Transform", {std::move(own)}, {}},
                       {"TransformLink", {std::move(link)}, {}}});
  };
  const FbxNode geometry =
      fbx_object("Geometry", 10, "surface", "Mesh",
                 {{"Vertices", {std::vector<double>{0, 0, 0, 10, 0, 0, 10, 50, 0, 0, 50, 0, 0, 100, 0, 0, 200, 0}}, {}},
                  {"PolygonVertexIndex", {std::vector<std::int32_t>{0, 1, 2, -4, 3, 4, -6}}, {}},
                  {"LayerElementUV",
                   {std::int64_t{0}},
                   {{"MappingInformationType", {std::string("ByPolygonVertex")}, {}},
                    {"UV", {std::vector<double>{0, 0, 1, 0, 1, 1, 0, 1}}, {}},
                    {"UVIndex", {std::vector<std::int32_t>{0, 1, 2, 3, 0, 1, 2}}, {}}}},
                  {"LayerElementMaterial", {std::int64_t{0}}, {{"Materials", {std::vector<std::int32_t>{0}}, {}}}}});
  const auto limb = [](std::int64_t id, const std::string& name, double height) {
    return fbx_object("Model", id, name, "LimbNode",
                      {{"Properties70", {}, {fbx_property70("Lcl Translation", {0, height, 0})}}});
  };
  const FbxNode curve = fbx_object("AnimationCurve", 33, "", "",
                                   {{"KeyTime", {std::vector<std::int64_t>{0, second}}, {}},
                                    {"KeyValueFloat", {std::vector<double>{0, 90}}, {}},
                                    {"KeyAttrFlags", {std::vector<std::int32_t>{0x4}}, {}},
                                    {"KeyAttrDataFloat", {std::vector<double>{0, 0, 0, 0}}, {}},
                                    {"KeyAttrRefCount", {std::vector<std::int32_t>{2}}, {}}});
  const auto connect = [](std::int64_t lower, std::int64_t upper, const std::string& property = "") {
    FbxNode connection{"C", {std::string(property.empty() ? "OO" : "OP"), lower, upper}, {}};
    if (!property.empty()) connection.values.emplace_back(property);
    return connection;
  };
  return {
      "",
      {},
      {{"FBXHeaderExtension", {}, {{"FBXVersion", {std::int64_t{7400}}, {}}}},
       {"GlobalSettings",
        {},
        {{"Properties70",
          {},
          {fbx_property70("UpAxis", {1}), fbx_property70("UpAxisSign", {1}), fbx_property70("UnitScaleFactor", {1})}}}},
       {"Objects",
        {},
        {geometry, fbx_object("Model", 1, "arm", "Mesh", {}), limb(2, "upper", 0), limb(3, "lower", 100),
         fbx_object("Material", 4, "cloth", "",
                    {{"Properties70", {}, {fbx_property70("DiffuseColor", {0.2, 0.4, 0.6})}}}),
         fbx_object("Deformer", 20, "skin", "Skin", {}), cluster(21, {0, 1, 2, 3}, {1, 1, 1, 0.5}, identity, identity),
         cluster(22, {3, 4, 5}, {0.5, 1, 1}, lowered, raised), fbx_object("AnimationStack", 30, "bend", "", {}),
         fbx_object("AnimationLayer", 31, "layer", "", {}),
         fbx_object("AnimationCurveNode", 32, "R", "",
                    {{"Properties70", {}, {fbx_property70("d|X", {0}), fbx_property70("d|Y", {0})}}}),
         curve}},
       {"Connections",
        {},
        {connect(1, 0), connect(2, 0), connect(3, 2), connect(10, 1), connect(4, 1), connect(20, 10), connect(21, 20),
         connect(22, 20), connect(2, 21), connect(3, 22), connect(31, 30), connect(32, 31),
         connect(32, 3, "Lcl Rotation"), connect(33, 32, "d|Z")}}}};
}

}  // namespace doppel::support
