#include "worldmodel/sim/draw_server.h"

int main() { return evac::sim::ServeDrawings(); }
