#include "tests/support/temp_folder.h"  // the library needs one translation unit
