#pragma once

#include <filesystem>

#include "doppel/actor/export/quantized_weights.h"
#include "doppel/view/view_subject.h"

namespace doppel {

/// Writes a page that any file server can serve: the actor, its motion and its networks, which the visitor's browser
/// runs itself (ONNX Runtime, WebAssembly).
///
/// `folder` gets
/// - `index.html` and `assets/`: the page
/// - `double/`: the files of view_files.h and ONNX models. For a stage `STAGE.onnx`: `window` [B,F+1,D] -> `vertices`
///   [B,N,3]; for one with a dynamic texture: `window`, `projection` [B,3,4], `vertices` -> `texture` [B,T,T,3];
///   for Gaussians, the same inputs -> `gaussians` [B,P,14] (splat_rows.h). `joints.onnx`: `dofs` [B,D] -> `joints`
///   [B,J,3]
/// - `runtime/`: ONNX Runtime, 14 MB, fetched on first use (core/fetch/package_files.h)
///
/// A folder that exists is replaced only if it holds such a page.
/// @param quantized those of subject.networks, or none @pre the subject has a character
/// @throws UsageError when `folder` exists and holds something else; Error as onnx_model and find_package_file. Then
/// nothing is written.
void write_web_folder(const std::filesystem::path& folder, const ViewSubject& subject,
                      const QuantizedWeights& quantized = {});

/// The constants of all models of such a folder (read_onnx_constants).
NamedWeights read_web_constants(const std::filesystem::path& folder, const ViewSubject& subject);

}  // namespace doppel
