/* What this runtime has. The exporter puts another file in place of this one: with the FMU's own HC_PREFIX, and with
 * HC_DELAYS where inputs act late.
 */
#ifndef HC_OPTIONS_H
#define HC_OPTIONS_H

#ifndef HC_DELAYS
#define HC_DELAYS 0 /* inputs that act late */
#endif

#include "hc_names.h"

#endif
