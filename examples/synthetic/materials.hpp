// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "synthetic/texture.hpp"

/// Painted surfaces of the synthetic sequence: each function paints one texture from a seed.
namespace stillpoint::synthetic {

/// An image made of sky, hills and random things, in a rectangle of the canvas.
void paint_photo(Canvas& canvas, int x0, int y0, int x1, int y1, std::uint64_t seed);

void paint_chart(Canvas& canvas, int x0, int y0, int x1, int y1, std::uint64_t seed);

/// A poster: title bar, columns of text, photos and charts.
Canvas poster(int width, int height, std::uint64_t seed);

/// A framed photo.
Canvas framed_photo(int width, int height, std::uint64_t seed);

/// A shelf's row of books: spines of many widths and heights with titles.
Canvas books(int width, int height, std::uint64_t seed);

Canvas plaster(std::uint64_t seed);

Canvas carpet(std::uint64_t seed);

Canvas ceiling(std::uint64_t seed);

Canvas wood(Color color, std::uint64_t seed);

/// A carton with printed labels, arrows and tape.
Canvas carton(std::uint64_t seed);

/// A monitor: windows with text and an image.
Canvas screen(std::uint64_t seed);

/// A printed sheet.
Canvas sheet(std::uint64_t seed);

/// A door leaf with panels, a notice and a handle.
Canvas door(std::uint64_t seed);

}  // namespace stillpoint::synthetic
