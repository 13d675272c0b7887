#pragma once

/// What the subcommands of `doppel track` share.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "command.h"
#include "detected_capture.h"
#include "doppel/core/folder_lock.h"
#include "doppel/track/livecap/livecap_config.h"
#include "doppel/track/preview.h"
#include "doppel/track/track_capture.h"

namespace doppel::tools {

/// Options of more than one method.
struct TrackArguments {
  std::string capture;
  TrackTask task;
  std::string config;  ///< empty: the defaults
  std::vector<std::string> set;
  std::string camera;        ///< empty: the only camera of the capture
  std::string prior_motion;  ///< file of poses that the person usually takes; empty: none
  std::string preview, texture;
  int sheet_frames = TrackOptions().sheet_frames;
};

/// A subcommand of `doppel track` with the capture, --out and --limit-frames. Options before its word are an error,
/// because they belong to the multi-view fit.
CLI::App* add_track_method(CLI::App& track, const std::string& name, const std::string& description,
                           TrackArguments& arguments);

CLI::Option* add_capture_option(CLI::App& app, TrackArguments& arguments);
/// --out and --limit-frames
void add_output_options(CLI::App& app, TrackArguments& arguments);
void add_sequences_option(CLI::App& app, TrackArguments& arguments);
void add_vertices_option(CLI::App& app, TrackArguments& arguments);
void add_sheet_option(CLI::App& app, TrackArguments& arguments);
void add_camera_option(CLI::App& app, TrackArguments& arguments);
/// --config and --set.
std::vector<CLI::Option*> add_config_options(CLI::App& app, TrackArguments& arguments);
CLI::Option* add_prior_motion_option(CLI::App& app, TrackArguments& arguments);
void add_preview_options(CLI::App& app, TrackArguments& arguments);

/// The configuration of --config and --set.
ConfigDocument config_document(const TrackArguments& arguments);
/// Adds the poses of --prior-motion, if a file of them was given.
void add_prior_motion(LivecapConfig& config, const TrackArguments& arguments, const Character& character);
TrackViewOptions view_options(const TrackArguments& arguments);
/// The preview, or nothing without --preview.
std::unique_ptr<Preview> preview_of(const TrackArguments& arguments, const PinholeCamera& camera,
                                    const Character& character, double frames_per_second);

/// Chooses and locks the output folder, and begins a shard.
/// @throws UsageError for a shard of a capture without keypoints; Error as FolderLock
FolderLock begin_track(TrackArguments& arguments, const CommonOptions& common);
/// Runs `doppel detect` for a capture without keypoints; `arguments.capture` is then its result.
void find_keypoints(TrackArguments& arguments, const DetectNeeds& needs, const CommonOptions& common);
/// Prints the report. @param results says where they are @return the exit code
int finish_track(const TrackReport& report, const TrackArguments& arguments, const CommonOptions& common,
                 const std::string& results);
/// Everything around `track`, which tracks the chosen sequences of the capture. @return the exit code
int track_sequences(TrackArguments arguments, const CommonOptions& common, bool needs_masks,
                    const std::function<TrackReport(const TrackArguments&)>& track);

/// The subcommands of `doppel track`.
Command add_track_livecap(CLI::App& track);
Command add_track_deepcap(CLI::App& track);
Command add_track_points(CLI::App& track);
Command add_track_refine(CLI::App& track);
Command add_track_live(CLI::App& track);

}  // namespace doppel::tools
