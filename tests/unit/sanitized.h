/* sanitized.h - whether this is compiled with the address or the thread sanitizer, which are slow; coverage builds, which
 * are slow too, define SANITIZED themselves. */
#ifndef SANITIZED_H
#define SANITIZED_H

#if defined(__has_feature)
#define SANITIZED       __has_feature(address_sanitizer)
#define THREADS_WATCHED __has_feature(thread_sanitizer)
#else
#ifdef __SANITIZE_ADDRESS__
#define SANITIZED 1
#endif
#ifdef __SANITIZE_THREAD__
#define THREADS_WATCHED 1
#endif
#endif
#ifndef SANITIZED
#define SANITIZED 0
#endif
#ifndef THREADS_WATCHED
#define THREADS_WATCHED 0
#endif

/* Make the memory of an object usable again: the sanitizer still guards its red zones. */
#if SANITIZED
#include <sanitizer/asan_interface.h>
#define TAKE_BACK(memory, bytes) ASAN_UNPOISON_MEMORY_REGION(memory, bytes)
#else
#define TAKE_BACK(memory, bytes) ((void)0)
#endif
#endif
