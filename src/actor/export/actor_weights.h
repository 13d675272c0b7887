#pragma once

#include <filesystem>

#include "doppel/actor/export/actor_metadata.h"
#include "doppel/actor/export/quantized_weights.h"
#include "doppel/actor/export/script_file.h"

namespace doppel {

/// Writes what a host of one's own needs, without code. A safetensors file holds the parameters and buffers of the
/// networks (`egnet.`, `deltanet.`, `texnet.`, ...) and the character (`template.`, `skin.`, `skeleton.`, `graph.`).
/// `<stem>.json` beside it describes the actor as metadata.json does and says what each tensor of the character is; its
/// field `quantized` gives the rule for quantized weights, whose scales stand beside them (NAME.scale). Larger numbers
/// come first, so that each tensor is aligned. docs/export.md has the table.
void write_actor_weights(const std::filesystem::path& path, const Character& character,
                         const ActorDescription& description, const ScriptModules& modules,
                         const QuantizedWeights& quantized = {});

}  // namespace doppel
