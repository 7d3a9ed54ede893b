/* Build options of the runtime. The exporter replaces this file by one with the FMU's own HC_PREFIX, and with
 * HC_DELAYS if inputs are delayed.
 */
#ifndef HC_OPTIONS_H
#define HC_OPTIONS_H

#ifndef HC_DELAYS
#define HC_DELAYS 0 /* 1: with delayed inputs */
#endif

#include "hc_names.h"

#endif
