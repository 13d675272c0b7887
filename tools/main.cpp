#include "doppel/core/process.h"
#include "program.h"

int main(int argc, char** argv) {
  doppel::start_tuned(argv);
  doppel::setup_process();
  return doppel::tools::run_program(argc, argv);
}
