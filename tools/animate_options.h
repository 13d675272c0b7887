#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "animate_engine.h"
#include "doppel/actor/export/figure_writer.h"

namespace doppel::tools {

/// What `doppel animate` is asked for.
struct AnimateOptions {
  std::string character, model, run, out;
  std::vector<std::string> motions;
  std::string renderer = "mesh";
  std::vector<std::string> formats{"npy"};
  std::string bone_rule = "exact";
  // Motion of another body.
  std::string source_skeleton, map, animation, person, up;
  double unit = 0.0, source_fps = 0.0, fps = 0.0;
  // The camera.
  std::string camera = "orbit", calibration, capture, background, beside, light;
  int size = 0, samples = 3;
  double turns_per_second = 0.1;
  // The figure for other programs.
  std::string names = "skeletool";
  FigureRights rights;
  std::optional<int> morphs;
  EngineOptions engine;
  double tolerance_mm = 0.1;
  bool compress = false;
  bool loop = false;
  std::string root = "travel";
  // Files that state neither unit nor axis.
  std::optional<double> out_unit;
  std::string out_up;

  bool wants(const char* format) const { return std::find(formats.begin(), formats.end(), format) != formats.end(); }
  BoneNames bone_names() const { return bone_names_of(names); }
  /// Of the files that state neither unit nor axis.
  FileSpace file_space() const { return {out_unit.value_or(1.0), out_up == "z"}; }
};

void add_animate_options(CLI::App& app, AnimateOptions& options);

/// @throws UsageError for options that belong to formats which are not written
void check_animate_options(const AnimateOptions& options);

}  // namespace doppel::tools
