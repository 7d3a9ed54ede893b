/* Runs of a sweep side by side: a right-hand side for HC_LANES points at once, one per vector lane.
 */
#ifndef HC_LANES_H
#define HC_LANES_H

#include <stddef.h>

#include "hc_model.h"
#include "hc_rk4.h"

enum { HC_LANES = 8 };

#define HC_EACH_LANE HC_SIDE_BY_SIDE(HC_LANES)

/* Signal i of lane l is at [i * HC_LANES + l]; modes are doubles, and none is zero: nothing sticks. */
typedef void (*hc_lanes_function)(const double *t, const double *x, const double *u, const double *p, const double *mode,
                                  double *dx);

/* Defined by a generated lanes.c; NULL if vectors are no faster. Functions such as sine have errors up to 4
 * units in the last place; see hc_lanes_math.h. */
extern const hc_lanes_function hc_model_lanes;

typedef struct hc_lanes hc_lanes;
struct hc_run;

/* NULL if there is no memory. `step` is the fixed step of Runge-Kutta. */
hc_lanes *hc_lanes_new(const hc_model_type *model, hc_lanes_function derivatives, double step);
void hc_lanes_free(hc_lanes *lanes);

/* Integrate `count` <= HC_LANES started runs to their ends. */
void hc_lanes_run(hc_lanes *lanes, struct hc_run *runs, int count);

#endif
