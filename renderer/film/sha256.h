// Moved: see renderer/core/sha256.h.
#pragma once
#include "renderer/core/sha256.h"
