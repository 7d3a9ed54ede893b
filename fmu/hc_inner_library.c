/* The library of the FMU inside: where it lies and how the system loads it. */
#include "hc_inner.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined _WIN32
#include <windows.h>
#define SEPARATOR '\\'
#define SUFFIX ".dll"
#else
#include <dlfcn.h>
#define SEPARATOR '/'
#if defined __APPLE__
#define SUFFIX ".dylib"
#else
#define SUFFIX ".so"
#endif
#endif

#if defined __aarch64__ || defined _M_ARM64
#define MACHINE "aarch64"
#else
#define MACHINE "x86_64"
#endif

/* The folder in `binaries`, as FMI 3 and as FMI 2 name it. */
#if defined _WIN32
#define SYSTEM "windows"
#define SHORT_NAME "win64"
#elif defined __APPLE__
#define SYSTEM "darwin"
#define SHORT_NAME "darwin64"
#else
#define SYSTEM "linux"
#define SHORT_NAME "linux64"
#endif

#if defined _WIN32

/* Paths are UTF-8; Windows wants UTF-16. Libraries that lie beside the inner library are found. */
void *hc_library_open(const char *path, char *text, size_t size)
{
    HMODULE found = NULL;
    const int n = MultiByteToWideChar(CP_UTF8, 0, path, -1, NULL, 0);
    WCHAR *wide = n > 0 ? malloc((size_t)n * sizeof *wide) : NULL;
    if (wide && MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, n) == n)
        found = LoadLibraryExW(wide, NULL, LOAD_WITH_ALTERED_SEARCH_PATH);
    if (!found)
        snprintf(text, size, "%.400s: error %lu of LoadLibrary", path, (unsigned long)GetLastError());
    free(wide);
    return (void *)found;
}

void (*hc_library_find(void *library, const char *name))(void)
{
    return (void (*)(void))GetProcAddress((HMODULE)library, name);
}

void hc_library_close(void *library)
{
    FreeLibrary((HMODULE)library);
}

#else

void *hc_library_open(const char *path, char *text, size_t size)
{
    void *found = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    const char *reason = found ? NULL : dlerror();
    if (!found)
        snprintf(text, size, "%.400s", reason ? reason : path);
    return found;
}

void (*hc_library_find(void *library, const char *name))(void)
{
    void (*function)(void);
    void *found = dlsym(library, name);
    memcpy(&function, &found, sizeof function); /* POSIX: an object's and a function's pointer have one form */
    return function;
}

void hc_library_close(void *library)
{
    dlclose(library);
}

#endif

static int hexadecimal(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* RFC 8089: file:///a%20b, file://localhost/a, file:/a; on Windows the path is what follows the third slash. */
static const char *without_scheme(const char *folder, int *is_uri)
{
    *is_uri = strncmp(folder, "file:", 5) == 0;
    if (!*is_uri)
        return folder;
    folder += 5;
    if (strncmp(folder, "//localhost/", 12) == 0)
        folder += 11;
    else if (strncmp(folder, "///", 3) == 0)
        folder += 2;
#if defined _WIN32
    if (folder[0] == '/' && folder[1] && folder[2] == ':')
        folder++;
#endif
    return folder;
}

char *hc_library_path(const char *folder, const char *rest)
{
    int is_uri;
    const char *from = without_scheme(folder, &is_uri);
    char *path = malloc(strlen(from) + strlen(rest) + 2);
    size_t n = 0;
    if (!path)
        return NULL;
    for (; *from; from++) {
        const int high = is_uri && *from == '%' ? hexadecimal(from[1]) : -1;
        const int low = high >= 0 ? hexadecimal(from[2]) : -1;
        path[n++] = low >= 0 ? (char)(16 * high + low) : *from;
        from += low >= 0 ? 2 : 0;
    }
    while (n > 1 && (path[n - 1] == '/' || path[n - 1] == SEPARATOR))
        n--;
    path[n++] = SEPARATOR;
    for (; *rest; rest++)
        path[n++] = *rest == '/' ? SEPARATOR : *rest;
    path[n] = '\0';
    return path;
}

char *hc_library_place(const char *identifier, int fmi)
{
    const char *platform = fmi == 2 && strcmp(MACHINE, "x86_64") == 0 ? SHORT_NAME : MACHINE "-" SYSTEM;
    const size_t size = strlen(identifier) + 80;
    char *place = malloc(size);
    if (place)
        snprintf(place, size, "inner/binaries/%s/%s" SUFFIX, platform, identifier);
    return place;
}
