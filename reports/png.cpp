#include "reports/png.h"

#include <librsvg/rsvg.h>

#include <cmath>
#include <memory>

#include "core/error.h"

namespace evac {
namespace {

template <auto Free>
struct Freed {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};
using Handle = std::unique_ptr<RsvgHandle, Freed<g_object_unref>>;
using Surface = std::unique_ptr<cairo_surface_t, Freed<cairo_surface_destroy>>;
using Context = std::unique_ptr<cairo_t, Freed<cairo_destroy>>;

Error Refused(const char* what, GError* error) {
  const std::unique_ptr<GError, Freed<g_error_free>> owned(error);
  return InternalError("png: {}: {}", what, error == nullptr ? "no reason given" : error->message);
}

/// Nothing may be thrown through C: what does not fit into memory is refused.
cairo_status_t Append(void* png, const unsigned char* bytes, unsigned int count) noexcept try {
  static_cast<std::string*>(png)->append(reinterpret_cast<const char*>(bytes), count);
  return CAIRO_STATUS_SUCCESS;
} catch (...) {
  return CAIRO_STATUS_NO_MEMORY;
}

Handle Parse(const std::string& svg) {
  GError* error = nullptr;
  Handle handle(rsvg_handle_new_from_data(reinterpret_cast<const guint8*>(svg.data()), svg.size(), &error));
  if (!handle) throw Refused("the SVG cannot be read", error);
  return handle;
}

}  // namespace

std::string PngOf(const std::string& svg, double scale) {
  if (!(scale > 0 && scale <= 16)) throw InvalidInput("png: scale is {}, wanted a number in (0, 16]", scale);
  const Handle handle = Parse(svg);
  double width = 0, height = 0;
  if (!rsvg_handle_get_intrinsic_size_in_pixels(handle.get(), &width, &height))
    throw InternalError("png: the SVG has no size in pixels");
  const Surface surface(cairo_image_surface_create(CAIRO_FORMAT_ARGB32, static_cast<int>(std::ceil(width * scale)),
                                                   static_cast<int>(std::ceil(height * scale))));
  const Context context(cairo_create(surface.get()));
  cairo_scale(context.get(), scale, scale);
  const RsvgRectangle viewport{0, 0, width, height};
  GError* error = nullptr;
  if (!rsvg_handle_render_document(handle.get(), context.get(), &viewport, &error))
    throw Refused("the SVG cannot be drawn", error);
  std::string png;
  const cairo_status_t status = cairo_surface_write_to_png_stream(surface.get(), Append, &png);
  if (status != CAIRO_STATUS_SUCCESS) throw InternalError("png: {}", cairo_status_to_string(status));
  return png;
}

}  // namespace evac
