/* What the shared library exports: everything marked HALFSHADE_API, nothing else. C and C++. */
#ifndef HALFSHADE_EXPORT_H
#define HALFSHADE_EXPORT_H

#if defined(__GNUC__)
#define HALFSHADE_API __attribute__((visibility("default")))
/* Inside an exported class, but not exported. */
#define HALFSHADE_LOCAL __attribute__((visibility("hidden")))
#else
#define HALFSHADE_API
#define HALFSHADE_LOCAL
#endif

#endif
