#pragma once

#include <cstdint>
#include <vector>

#include "worldmodel/train/adamw.h"
#include "worldmodel/train/flat_parameters.h"

/// Muon (Jordan et al. 2024): the step of a matrix is its momentum with all singular values brought near 1, so that
/// directions which the gradient hardly shows are learned too. Not in the paper; an option (docs/train.md).
namespace evac::train {

/// A parameter that is trained as a matrix, in the vector of all: [rows, columns] floats from `from`. Convolutions are
/// [out, everything else].
struct MatrixPlace {
  std::int64_t from = 0, rows = 0, columns = 0;
  std::int64_t count() const { return rows * columns; }
};

/// Those of the parameters that have two axes or more and at least 16 rows and columns, tables of so many rows among
/// them (positional_embedding, a domain_embedding of 16 domains or more); the others (offsets, gains, smaller tables, a
/// network's last layer of a few channels) stay AdamW's.
std::vector<MatrixPlace> MatricesOf(const std::vector<NamedTensor>& parameters);

/// `matrix` with its singular values brought near 1 (about .7 to 1.2) by five steps of Newton and Schulz's iteration
/// with Jordan's coefficients. @param matrix  [rows, columns] floats
Tensor Orthogonalised(const Tensor& matrix);

/// One step: the matrices by Muon (Nesterov's momentum of `momentum`), all else by AdamW, the average of both;
/// gradients become 0. A matrix's step is .2 √max(rows, columns) times the orthogonalised momentum (Liu et al. 2025):
/// as long as AdamW's steps are, so that one learning rate and one weight decay serve both.
/// @param workers  threads that share the matrices, this one among them; changes no number
void StepMuon(const AdamWState& state, const std::vector<MatrixPlace>& matrices, double momentum,
              const AdamWOptions& options, const AdamWStep& step, std::size_t workers = 1);

}  // namespace evac::train
