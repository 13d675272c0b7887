#include "doppel/core/process.h"
#include "program.h"

int main(int argc, char** argv) {
  doppel::limit_spinning(argv);
  doppel::setup_process();
  return doppel::tools::run_program(argc, argv);
}
