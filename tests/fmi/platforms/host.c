/* Loads an FMU's shared library (FMI 3, Co-Simulation) and prints what it computes, one number a line. */
#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#include <windows.h>
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW)
#define FIND(library, name) dlsym(library, name)
#endif

typedef void *instance_type;
typedef instance_type instantiate_type(const char *, const char *, const char *, _Bool, _Bool, _Bool, _Bool,
                                       const unsigned *, size_t, void *, void *, void *);
typedef int enter_type(instance_type, _Bool, double, double, _Bool, double);
typedef int plain_type(instance_type);
typedef int set_type(instance_type, const unsigned *, size_t, const double *, size_t);
typedef int get_type(instance_type, const unsigned *, size_t, double *, size_t);
typedef int step_type(instance_type, double, double, _Bool, _Bool *, _Bool *, _Bool *, double *);
typedef int directional_type(instance_type, const unsigned *, size_t, const unsigned *, size_t, const double *, size_t,
                             double *, size_t);

static void check(int ok, const char *what)
{
    if (!ok) {
        printf("failed: %s\n", what);
        exit(1);
    }
}

int main(int argc, char **argv)
{
    check(argc == 3, "arguments: library, token");
    void *library = OPEN(argv[1]);
    check(library != NULL, "load");
    instantiate_type *instantiate = (instantiate_type *)FIND(library, "fmi3InstantiateCoSimulation");
    enter_type *enter = (enter_type *)FIND(library, "fmi3EnterInitializationMode");
    plain_type *leave = (plain_type *)FIND(library, "fmi3ExitInitializationMode");
    set_type *set = (set_type *)FIND(library, "fmi3SetFloat64");
    get_type *get = (get_type *)FIND(library, "fmi3GetFloat64");
    step_type *step = (step_type *)FIND(library, "fmi3DoStep");
    directional_type *directional = (directional_type *)FIND(library, "fmi3GetDirectionalDerivative");
    check(instantiate && enter && leave && set && get && step && directional, "symbols");
    instance_type c = instantiate("host", argv[2], NULL, 0, 0, 0, 0, NULL, 0, NULL, NULL, NULL);
    check(c != NULL, "instantiate");
    check(enter(c, 0, 0.0, 0.0, 0, 0.0) == 0 && leave(c) == 0, "initialize");
    const unsigned inputs[] = {13, 14}, states[] = {1, 2, 3, 4, 5, 6}, derivatives[] = {10, 11, 12};
    for (int k = 0; k < 300; k++) {
        const double commands[] = {k < 100 ? 1.5 : 0.0, 0.3};
        double y[6], reached;
        _Bool event, end, early;
        check(set(c, inputs, 2, commands, 2) == 0, "set");
        check(step(c, 0.01 * k, 0.01, 1, &event, &end, &early, &reached) == 0, "step");
        check(get(c, states, 6, y, 6) == 0, "get");
        for (int i = 0; k % 20 == 19 && i < 6; i++)
            printf("%.17g\n", y[i]);
    }
    const double seed[] = {1.0, -2.0};
    double product[3];
    check(directional(c, derivatives, 3, inputs, 2, seed, 2, product, 3) == 0, "directional derivative");
    printf("%.17g\n%.17g\n%.17g\n", product[0], product[1], product[2]);
    return 0;
}
