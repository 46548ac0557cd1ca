// Memory for tests, to be preloaded (LD_PRELOAD): counts the allocations that the program itself (operator new and
// malloc called in it), or the libraries whose paths contain $PLIANT_MEMORY_OF, make from the first signal() on, which
// the program calls when it starts. Number $PLIANT_MEMORY_FAILS fails; with $PLIANT_MEMORY_ALL all later allocations
// fail too. $PLIANT_MEMORY_COUNT gets their number when the program exits.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* memory, size_t size);
void* __libc_memalign(size_t alignment, size_t size);

enum { most_ranges = 64 };
static struct { uintptr_t first, last; } range[most_ranges];
static int ranges = 0;
static const char* of = NULL;
static long fails = 0;
static int all = 0;
static atomic_int started = 0;
static atomic_long count = 0;

static int add_object(struct dl_phdr_info* object, size_t size, void* data) {
  (void)size, (void)data;
  const int wanted = of == NULL ? object->dlpi_name[0] == '\0' : strstr(object->dlpi_name, of) != NULL;
  for (int k = 0; wanted && k < object->dlpi_phnum && ranges < most_ranges; ++k) {
    const ElfW(Phdr)* part = &object->dlpi_phdr[k];
    if (part->p_type != PT_LOAD || !(part->p_flags & PF_X)) continue;
    range[ranges].first = object->dlpi_addr + part->p_vaddr;
    range[ranges].last = range[ranges].first + part->p_memsz;
    ++ranges;
  }
  return 0;
}

typedef void (*handler)(int);

handler signal(int number, handler action) {
  if (!atomic_exchange(&started, 1)) {
    of = getenv("PLIANT_MEMORY_OF");
    const char* text = getenv("PLIANT_MEMORY_FAILS");
    fails = text == NULL ? 0 : atol(text);
    all = getenv("PLIANT_MEMORY_ALL") != NULL;
    dl_iterate_phdr(add_object, NULL);
  }
  return ((handler(*)(int, handler))dlsym(RTLD_NEXT, "signal"))(number, action);
}

static int failing(const void* caller) {
  const uintptr_t at = (uintptr_t)caller;
  for (int k = 0; k < ranges; ++k) {
    if (at < range[k].first || at >= range[k].last) continue;
    const long number = 1 + atomic_fetch_add(&count, 1);
    if (fails == 0 || !(number == fails || (all && number > fails))) return 0;
    errno = ENOMEM;
    return 1;
  }
  return 0;
}

#define CALLER __builtin_return_address(0)

void* malloc(size_t size) { return failing(CALLER) ? NULL : __libc_malloc(size); }
void* calloc(size_t number, size_t size) { return failing(CALLER) ? NULL : __libc_calloc(number, size); }
void* realloc(void* memory, size_t size) { return size > 0 && failing(CALLER) ? NULL : __libc_realloc(memory, size); }
void* memalign(size_t alignment, size_t size) { return failing(CALLER) ? NULL : __libc_memalign(alignment, size); }
void* aligned_alloc(size_t alignment, size_t size) { return failing(CALLER) ? NULL : __libc_memalign(alignment, size); }
int posix_memalign(void** memory, size_t alignment, size_t size) {
  if (failing(CALLER)) return ENOMEM;
  *memory = __libc_memalign(alignment, size);
  return *memory == NULL ? ENOMEM : 0;
}

__attribute__((destructor)) static void report(void) {
  const char* name = getenv("PLIANT_MEMORY_COUNT");
  const int file = name == NULL ? -1 : open(name, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (file >= 0) dprintf(file, "%ld\n", atomic_load(&count));
}
