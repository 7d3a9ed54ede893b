/* Private to the runtime: the FMU inside a corrected FMU. Its library lies in the outer FMU's resources:
 *     resources/inner/binaries/<platform>/<identifier>.so (.dll, .dylib),  resources/inner/resources
 * These calls have the same form for both versions of FMI; hc_inner_fmi2.c and hc_inner_fmi3.c make them. Functions
 * that return int return a status of hc_instance.h, or HC_FATAL; the inner FMU's messages go to the importer's logger.
 */
#ifndef HC_INNER_H
#define HC_INNER_H

#include <stddef.h>

#include "hc_options.h"

enum { HC_FATAL = 4 };

/* ---- hc_inner_library.c ---- */

/* A shared library; NULL, with a reason in `text`, if it cannot be loaded. */
void *hc_library_open(const char *path, char *text, size_t size);
/* The address of a function; NULL if the library has none of that name. */
void (*hc_library_find(void *library, const char *name))(void);
void hc_library_close(void *library);
/* Join a folder and the rest of a path in memory of malloc. `folder` is a path or a URI of the form file:///... */
char *hc_library_path(const char *folder, const char *rest);
/* The place of the inner library below the resources. */
char *hc_library_place(const char *identifier, int fmi);

/* ---- hc_inner_fmi2.c, hc_inner_fmi3.c ---- */

typedef struct hc_inner hc_inner;

/* What an FMU says after an event; `next` is DBL_MAX where there is no next event. */
typedef struct {
    int again, terminate, nominals_changed, states_changed;
    double next;
} hc_inner_event;

int hc_inner_get(hc_inner *inner, const unsigned *vr, size_t n, double *value);
int hc_inner_set(hc_inner *inner, const unsigned *vr, size_t n, const double *value);
/* The same where variables are arrays: n_values numbers. */
int hc_inner_get_values(hc_inner *inner, const unsigned *vr, size_t n, double *value, size_t n_values);
int hc_inner_set_values(hc_inner *inner, const unsigned *vr, size_t n, const double *value, size_t n_values);
int hc_inner_set_time(hc_inner *inner, double time);
int hc_inner_set_states(hc_inner *inner, const double *x, size_t n);
int hc_inner_get_states(hc_inner *inner, double *x, size_t n);
int hc_inner_get_derivatives(hc_inner *inner, double *dx, size_t n);
int hc_inner_get_indicators(hc_inner *inner, double *z, size_t n);
int hc_inner_get_nominals(hc_inner *inner, double *x, size_t n);
int hc_inner_completed_step(hc_inner *inner, int *event, int *terminate);
int hc_inner_enter_event(hc_inner *inner);
int hc_inner_update(hc_inner *inner, hc_inner_event *event);
int hc_inner_enter_continuous(hc_inner *inner);
/* Co-Simulation; `ended` where the FMU ends the simulation or does not reach the end of the step. */
int hc_inner_step(hc_inner *inner, double time, double length, int *ended);
int hc_inner_reset(hc_inner *inner);
/* Products with its matrix of partial derivatives; n_seed and n_sensitivity are numbers of values. */
int hc_inner_partials(hc_inner *inner, int adjoint, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                      size_t n_known, const double *seed, size_t n_seed, double *sensitivity, size_t n_sensitivity);
/* Saved states: `*state` NULL makes a new one. */
int hc_inner_save(hc_inner *inner, void **state);
int hc_inner_load(hc_inner *inner, void *state);
int hc_inner_forget(hc_inner *inner, void **state);
int hc_inner_bytes(hc_inner *inner, void *state, size_t *size);
int hc_inner_write(hc_inner *inner, void *state, unsigned char *bytes, size_t size);
int hc_inner_read(hc_inner *inner, const unsigned char *bytes, size_t size, void **state);

#endif
