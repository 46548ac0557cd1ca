// A disk for tests, to be preloaded (LD_PRELOAD): for all files below the folder $PLIANT_DISK_FOLDER it
// - records every change in $PLIANT_DISK_LOG, of any process, in the order in which they are made;
// - is full after $PLIANT_DISK_BYTES bytes, and lacks fallocate, as some file systems.
// The log is a row of records: kind, length of the path (uint32), offset, number of bytes (uint64), path, bytes.
// Kinds: O created or emptied, W written, T cut or extended to `offset`, R renamed to the path in the bytes, U removed,
// S synced (a file or a folder).
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))real(#name))

enum { most_files = 1024 };
static char* path_of[most_files];
static int64_t used = 0;

static void* real(const char* name) { return dlsym(RTLD_NEXT, name); }

static int watched(const char* path) {
  const char* folder = getenv("PLIANT_DISK_FOLDER");
  return folder != NULL && path != NULL && strncmp(path, folder, strlen(folder)) == 0;
}

static const char* path_at(int fd) { return fd >= 0 && fd < most_files ? path_of[fd] : NULL; }

/// The log, locked, so that its order is the order of the changes; -1: nothing is recorded.
static int begin(void) {
  static int log = -2;
  if (log == -2) {
    const char* name = getenv("PLIANT_DISK_LOG");
    log = name == NULL ? -1 : REAL(open)(name, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  }
  if (log >= 0) flock(log, LOCK_EX);
  return log;
}

static void end(int log, char kind, const char* path, uint64_t offset, const void* data, uint64_t size) {
  if (log < 0) return;
  const int saved = errno;
  if (kind != 0) {
    const uint32_t length = (uint32_t)strlen(path);
    struct iovec parts[6] = {{&kind, 1}, {(void*)&length, 4},   {&offset, 8},
                             {&size, 8}, {(void*)path, length}, {(void*)data, size}};
    ssize_t all = 0;
    for (int k = 0; k < 6; ++k) all += (ssize_t)parts[k].iov_len;
    if (REAL(writev)(log, parts, 6) != all) abort();
  }
  flock(log, LOCK_UN);
  errno = saved;
}

// ---- opening and closing

static int opened(int fd, const char* path, int flags, int existed, int log) {
  const int change = fd >= 0 && watched(path) && ((flags & O_TRUNC) || ((flags & O_CREAT) && !existed));
  end(log, change ? 'O' : 0, path, 0, NULL, 0);
  if (fd < 0 || fd >= most_files) return fd;
  free(path_of[fd]);
  const int changes = (flags & O_ACCMODE) != O_RDONLY || (flags & O_DIRECTORY);
  path_of[fd] = watched(path) && changes ? strdup(path) : NULL;
  return fd;
}

#define OPEN(name)                                                           \
  int name(const char* path, int flags, ...) {                               \
    va_list more;                                                            \
    va_start(more, flags);                                                   \
    const mode_t mode = (flags & O_CREAT) ? va_arg(more, mode_t) : 0;        \
    va_end(more);                                                            \
    if (!watched(path)) return REAL(name)(path, flags, mode);                \
    const int log = begin();                                                 \
    const int existed = access(path, F_OK) == 0;                             \
    return opened(REAL(name)(path, flags, mode), path, flags, existed, log); \
  }
OPEN(open)
OPEN(open64)

int close(int fd) {
  if (fd >= 0 && fd < most_files && path_of[fd] != NULL) {
    free(path_of[fd]);
    path_of[fd] = NULL;
  }
  return REAL(close)(fd);
}

// ---- writing

/// Number of the `size` bytes at `offset` that fit on the disk; -1, and errno, if none fits.
static ssize_t room(int fd, off_t offset, size_t size) {
  const char* limit = getenv("PLIANT_DISK_BYTES");
  if (limit == NULL || path_at(fd) == NULL) return (ssize_t)size;
  struct stat found;
  if (fstat(fd, &found) != 0) return -1;
  const int64_t growth = (int64_t)offset + (int64_t)size - (int64_t)found.st_size;
  if (growth <= 0) return (ssize_t)size;
  const int64_t missing = used + growth - atoll(limit);
  const int64_t fits = missing <= 0 ? (int64_t)size : (int64_t)size - missing;
  if (fits <= 0) {
    errno = ENOSPC;
    return -1;
  }
  used += missing <= 0 ? growth : growth - missing;
  return (ssize_t)fits;
}

static ssize_t write_at(int fd, const void* data, size_t size, off_t offset, int seek) {
  const int log = begin();
  const ssize_t fits = room(fd, offset, size);
  ssize_t done = fits;
  if (fits >= 0) done = seek ? REAL(write)(fd, data, (size_t)fits) : REAL(pwrite)(fd, data, (size_t)fits, offset);
  end(log, done > 0 ? 'W' : 0, path_at(fd), (uint64_t)offset, data, done > 0 ? (uint64_t)done : 0);
  return done;
}

ssize_t write(int fd, const void* data, size_t size) {
  if (path_at(fd) == NULL) return REAL(write)(fd, data, size);
  return write_at(fd, data, size, lseek(fd, 0, SEEK_CUR), 1);
}

ssize_t pwrite(int fd, const void* data, size_t size, off_t offset) {
  if (path_at(fd) == NULL) return REAL(pwrite)(fd, data, size, offset);
  return write_at(fd, data, size, offset, 0);
}
ssize_t pwrite64(int fd, const void* data, size_t size, off64_t offset) { return pwrite(fd, data, size, offset); }

ssize_t pwritev(int fd, const struct iovec* parts, int count, off_t offset) {
  if (path_at(fd) == NULL) return REAL(pwritev)(fd, parts, count, offset);
  ssize_t all = 0;
  for (int k = 0; k < count; ++k) {
    const ssize_t done = pwrite(fd, parts[k].iov_base, parts[k].iov_len, offset + all);
    if (done < 0) return all > 0 ? all : -1;
    all += done;
    if ((size_t)done < parts[k].iov_len) break;
  }
  return all;
}
ssize_t pwritev64(int fd, const struct iovec* parts, int count, off64_t offset) {
  return pwritev(fd, parts, count, offset);
}

ssize_t writev(int fd, const struct iovec* parts, int count) {
  if (path_at(fd) == NULL) return REAL(writev)(fd, parts, count);
  ssize_t all = 0;
  for (int k = 0; k < count; ++k) {
    const ssize_t done = write(fd, parts[k].iov_base, parts[k].iov_len);
    if (done < 0) return all > 0 ? all : -1;
    all += done;
    if ((size_t)done < parts[k].iov_len) break;
  }
  return all;
}

int ftruncate(int fd, off_t size) {
  if (path_at(fd) == NULL) return REAL(ftruncate)(fd, size);
  const int log = begin();
  struct stat found;
  fstat(fd, &found);
  const int result = REAL(ftruncate)(fd, size);
  if (result == 0 && size < found.st_size) used -= found.st_size - size;
  end(log, result == 0 ? 'T' : 0, path_at(fd), (uint64_t)size, NULL, 0);
  return result;
}
int ftruncate64(int fd, off64_t size) { return ftruncate(fd, size); }

int fallocate(int fd, int mode, off_t offset, off_t size) {
  if (path_at(fd) == NULL || getenv("PLIANT_DISK_BYTES") == NULL) return REAL(fallocate)(fd, mode, offset, size);
  errno = EOPNOTSUPP;
  return -1;
}
int fallocate64(int fd, int mode, off64_t offset, off64_t size) { return fallocate(fd, mode, offset, size); }

// ---- syncing

static int synced(int fd, int (*function)(int)) {
  if (path_at(fd) == NULL) return function(fd);
  const int log = begin();
  const int result = function(fd);
  end(log, result == 0 ? 'S' : 0, path_at(fd), 0, NULL, 0);
  return result;
}
int fsync(int fd) { return synced(fd, REAL(fsync)); }
int fdatasync(int fd) { return synced(fd, REAL(fdatasync)); }

// ---- names

int rename(const char* from, const char* to) {
  if (!watched(from)) return REAL(rename)(from, to);
  const int log = begin();
  const int result = REAL(rename)(from, to);
  for (int fd = 0; result == 0 && fd < most_files; ++fd) {
    if (path_of[fd] == NULL || strcmp(path_of[fd], from) != 0) continue;
    free(path_of[fd]);
    path_of[fd] = strdup(to);
  }
  end(log, result == 0 ? 'R' : 0, from, 0, to, strlen(to));
  return result;
}

static int removed(const char* path, int (*function)(const char*)) {
  if (!watched(path)) return function(path);
  const int log = begin();
  struct stat found = {0};
  stat(path, &found);
  const int result = function(path);
  if (result == 0 && S_ISREG(found.st_mode)) used -= found.st_size;
  end(log, result == 0 ? 'U' : 0, path, 0, NULL, 0);
  return result;
}
int unlink(const char* path) { return removed(path, REAL(unlink)); }
int remove(const char* path) { return removed(path, REAL(remove)); }
