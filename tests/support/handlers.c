// Preloaded (LD_PRELOAD), it installs handlers of most signals in MPI_Init, as LLVM does where hwloc loads OpenCL: each
// signal then ends the program, whether it was ignored or not.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <signal.h>

static void end(int number) {
  signal(number, SIG_DFL);
  raise(number);
}

static void install(void) {
  static const int numbers[] = {SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGUSR2, SIGQUIT, SIGXCPU, SIGXFSZ, SIGPIPE};
  for (unsigned k = 0; k < sizeof numbers / sizeof *numbers; ++k) signal(numbers[k], end);
}

int MPI_Init(int* argc, char*** argv) {
  int (*init)(int*, char***) = (int (*)(int*, char***))dlsym(RTLD_NEXT, "MPI_Init");
  const int code = init(argc, argv);
  install();
  return code;
}

int MPI_Init_thread(int* argc, char*** argv, int required, int* provided) {
  int (*init)(int*, char***, int, int*) = (int (*)(int*, char***, int, int*))dlsym(RTLD_NEXT, "MPI_Init_thread");
  const int code = init(argc, argv, required, provided);
  install();
  return code;
}
