#include "worldmodel/sim/box_contacts.h"

#include <Eigen/Core>
#include <algorithm>

namespace evac::sim {
namespace {

using Eigen::Map;
using Eigen::Vector3d;
using RotationRows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr double kToleranceM = 0.005;

mjfCollision MujocosOwn() {
  static const mjfCollision own = mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_BOX];  // read before it is replaced
  return own;
}

bool IsNear(const mjModel& model, const mjData& data, const mjtNum* point, int box) {
  const Vector3d from_centre = Map<const Vector3d>(point) - Map<const Vector3d>(data.geom_xpos + 3 * box);
  const Vector3d in_box = Map<const RotationRows>(data.geom_xmat + 9 * box).transpose() * from_centre;
  return (in_box.cwiseAbs() - Map<const Vector3d>(model.geom_size + 3 * box)).maxCoeff() < kToleranceM;
}

double ThinnerHalf(const mjModel& model, int box) { return Map<const Vector3d>(model.geom_size + 3 * box).minCoeff(); }

}  // namespace

bool IsPlausible(const mjModel& model, const mjData& data, const mjContact& contact, int geom1, int geom2) {
  const double deepest_m = ThinnerHalf(model, geom1) + ThinnerHalf(model, geom2) + kToleranceM;
  return contact.dist > -deepest_m && IsNear(model, data, contact.pos, geom1) &&
         IsNear(model, data, contact.pos, geom2);
}

int SoundBoxContacts(const mjModel* model, const mjData* data, mjContact* contacts, int geom1, int geom2,
                     mjtNum margin) {
  mjContact* const end = contacts + MujocosOwn()(model, data, contacts, geom1, geom2, margin);
  const auto impossible = [&](const mjContact& contact) { return !IsPlausible(*model, *data, contact, geom1, geom2); };
  return static_cast<int>(std::remove_if(contacts, end, impossible) - contacts);
}

void UseSoundBoxContacts() {
  static const bool done = [] {
    MujocosOwn();
    mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_BOX] = SoundBoxContacts;
    return true;
  }();
  static_cast<void>(done);
}

}  // namespace evac::sim
