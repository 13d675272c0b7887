#include "doppel/io/figure_export/glb_correctives.h"

namespace doppel {
namespace {

/// The index of an accessor with the numbers of an array, row by row.
template <typename Array>
tinygltf::Value written_array(GlbBuffer& buffer, const Array& array) {
  const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = array;
  return tinygltf::Value(buffer.floats({rows.data(), static_cast<std::size_t>(rows.size())}, 1, false));
}

tinygltf::Value::Object function_object(GlbBuffer& buffer, const CorrectiveFunction& function) {
  std::vector<float> rest;
  for (const Eigen::Quaterniond& turn : function.rest)
    for (const double value : {turn.x(), turn.y(), turn.z(), turn.w()}) rest.push_back(static_cast<float>(value));
  tinygltf::Value::Array lags, parents;
  for (const double lag : function.lags) lags.emplace_back(lag);
  for (const int parent : function.parents) parents.emplace_back(parent);
  return {{"version", tinygltf::Value(1)},
          {"lags", tinygltf::Value(std::move(lags))},
          {"limit", tinygltf::Value(static_cast<double>(function.limit))},
          {"parents", tinygltf::Value(std::move(parents))},
          {"rest", tinygltf::Value(buffer.floats(rest, 4, false))},
          {"mean", written_array(buffer, function.mean)},
          {"scale", written_array(buffer, function.scale)},
          {"linear", written_array(buffer, function.linear)},
          {"offset", written_array(buffer, function.offset)},
          {"hidden", written_array(buffer, function.hidden)},
          {"hiddenOffset", written_array(buffer, function.hidden_offset)},
          {"output", written_array(buffer, function.output)}};
}

}  // namespace

tinygltf::Value corrective_extras(GlbBuffer& buffer, const CorrectiveFunction& function) {
  return tinygltf::Value(function_object(buffer, function));
}

tinygltf::Value helper_extras(GlbBuffer& buffer, const HelperFunction& function) {
  tinygltf::Value::Object object = function_object(buffer, function.shares);
  object["low"] = written_array(buffer, function.low);
  object["high"] = written_array(buffer, function.high);
  return tinygltf::Value(std::move(object));
}

}  // namespace doppel
