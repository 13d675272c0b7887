#include "doppel/core/load_yaml.h"

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <sstream>
#include <vector>

namespace doppel {
namespace {

constexpr std::size_t kMaxYamlDepth = 100;
constexpr std::size_t kMaxYamlNodes = 1'000'000;

/// Reads a document without building it, and measures what it would become with its aliases written out.
class YamlMeasure : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark& /*mark*/) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& /*mark*/, YAML::anchor_t anchor) override { add_leaf(anchor); }
  void OnScalar(const YAML::Mark& mark, const std::string& /*tag*/, YAML::anchor_t anchor,
                const std::string& value) override {
    if (value.find('\0') != std::string::npos) refuse(mark, "a text holds a NUL character");
    add_leaf(anchor);
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto named = nodes_of_.find(anchor);
    if (named == nodes_of_.end()) refuse(mark, "an alias stands inside of what it names");
    repeated_ += named->second.nodes;
    if (repeated_ > kMaxYamlNodes) refuse(mark, "the aliases repeat more than 1000000 nodes");
    if (open_.size() + named->second.depth > kMaxYamlDepth) refuse_depth(mark);
    add(named->second);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& /*tag*/, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value /*style*/) override {
    begin(mark, anchor);
  }
  void OnSequenceEnd() override { end(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& /*tag*/, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value /*style*/) override {
    begin(mark, anchor);
  }
  void OnMapEnd() override { end(); }

 private:
  struct Extent {
    std::size_t nodes = 1, depth = 0;
  };
  struct Open {
    YAML::anchor_t anchor;
    Extent extent;
  };

  [[noreturn]] static void refuse(const YAML::Mark& mark, const std::string& fault) {
    throw YAML::ParserException(mark, fault);
  }
  [[noreturn]] static void refuse_depth(const YAML::Mark& mark) {
    refuse(mark, "lists and mappings are nested more than 100 deep");
  }

  void begin(const YAML::Mark& mark, YAML::anchor_t anchor) {
    if (open_.size() >= kMaxYamlDepth) refuse_depth(mark);
    open_.push_back({anchor, {}});
  }
  void end() {
    const Open closed = open_.back();
    open_.pop_back();
    if (closed.anchor != YAML::NullAnchor) nodes_of_[closed.anchor] = closed.extent;
    add(closed.extent);
  }
  void add_leaf(YAML::anchor_t anchor) {
    if (anchor != YAML::NullAnchor) nodes_of_[anchor] = {};
    add({});
  }
  /// Adds a finished node to the list or mapping around it.
  void add(const Extent& extent) {
    if (open_.empty()) return;
    Extent& around = open_.back().extent;
    around.nodes += extent.nodes;
    around.depth = std::max(around.depth, extent.depth + 1);
  }

  std::vector<Open> open_;
  std::map<YAML::anchor_t, Extent> nodes_of_;  ///< of finished anchors
  std::size_t repeated_ = 0;
};

}  // namespace

YAML::Node load_yaml(const std::string& text) {
  std::istringstream stream(text);
  YamlMeasure measure;
  YAML::Parser(stream).HandleNextDocument(measure);
  return YAML::Load(text);
}

}  // namespace doppel
