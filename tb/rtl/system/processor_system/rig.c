/* SPDX-License-Identifier: Apache-2.0
 * Stands in for the program around drive_control.c: the test sets what is measured and reads the decisions. */
#include "drive_control.h"

drive_state rig_state;
directmpc_decision rig_decision;
int rig_decisions;

drive_state measure(void)
{
    return rig_state;
}

void applied(const directmpc_decision *decision)
{
    rig_decision = *decision;
    rig_decisions++;
}
