// The exact plant of a drive as a unit of an FMU: machine and inverter with ideal switches, between two communication
// points under constant inputs.
//
// x' = (A + w W + sum over k of T_k[s_k]) [x; v_dc], with w the rotor speed and s_k the positions of the switches. The
// way over a step is the matrix exponential: Taylor to 16 terms at norm 1/2 or less, then doublings. So a step has no
// error of integration, whatever its size.
// Licence: Apache-2.0

#include <algorithm>
#include <cmath>
#include <cstring>

#include "unit.h"

namespace directmpc {
namespace {

using Matrix = std::vector<double>;  // rows of states, one column more

struct Output {
    size_t variable;
    std::vector<double> row;        // of the states
    double factor;                  // of a product: factor * (x_a x_b - x_c x_d)
    std::vector<size_t> product;
};

class Plant final : public Unit {
   public:
    void line(const std::string &kind, Line &line) override {
        std::string name;
        if (kind == "states") {
            line >> states_ >> scale_;
        } else if (kind == "begin") {
            line >> name;
            starts_.push_back(number(name));
        } else if (kind == "base") {
            base_ = matrix(line);
        } else if (kind == "speed") {
            line >> name;
            speed_ = number(name);
            by_speed_ = matrix(line);
        } else if (kind == "link") {
            line >> name;
            link_ = number(name);
        } else if (kind == "switch") {
            line >> name;
            const size_t variable = number(name);
            if (switches_.empty() || switches_.back().first != variable)
                switches_.push_back({variable, {}});
            switches_.back().second.push_back(matrix(line));
        } else if (kind == "out") {
            Output one{};
            line >> name;
            one.variable = number(name);
            one.row.resize(states_);
            for (double &value : one.row) line >> value;
            outputs_.push_back(one);
        } else if (kind == "product") {
            Output one{};
            line >> name >> one.factor;
            one.variable = number(name);
            one.product.resize(4);
            for (size_t &place : one.product) line >> place;
            outputs_.push_back(one);
        } else {
            throw Refused{"unit.txt: " + kind};
        }
    }

    void begin() override {
        x_.assign(states_, 0.0);
        for (size_t k = 0; k < starts_.size(); k++) x_[k] = values[starts_[k]];
        made_for_.clear();
        show();
    }

    double step(double from, double to, bool) override {
        std::vector<double> key{to - from, values[speed_]};
        for (const auto &[variable, tables] : switches_) key.push_back(values[variable]);
        // steps of one size differ in the last bit of their times: those share a way
        if (made_for_.empty() || std::fabs(key[0] - made_for_[0]) > 1e-12 * key[0] ||
            !std::equal(key.begin() + 1, key.end(), made_for_.begin() + 1)) {
            Matrix continuous = base_;
            for (size_t k = 0; k < continuous.size(); k++) {
                continuous[k] += key[1] * by_speed_[k];
                for (const auto &[variable, tables] : switches_)
                    continuous[k] += tables[static_cast<size_t>(values[variable])][k];
            }
            exponential(continuous, key[0] * scale_);
            made_for_ = key;
        }
        std::vector<double> next(states_);
        for (size_t row = 0; row < states_; row++) {
            double total = way_[row * (states_ + 1) + states_] * values[link_];
            for (size_t k = 0; k < states_; k++) total += way_[row * (states_ + 1) + k] * x_[k];
            next[row] = total;
        }
        x_ = next;
        show();
        return to;
    }

    size_t state_size() const override { return states_ * sizeof(double); }
    void save(uint8_t *bytes) const override {
        std::vector<double> x = x_;
        x.resize(states_);
        std::memcpy(bytes, x.data(), state_size());
    }
    void restore(const uint8_t *bytes) override {
        x_.resize(states_);
        std::memcpy(x_.data(), bytes, state_size());
    }

   private:
    Matrix matrix(Line &line) const {
        Matrix read(states_ * (states_ + 1));
        for (double &value : read) line >> value;
        return read;
    }

    // left * right, both with a last row of zeros that is not kept
    Matrix product(const Matrix &left, const Matrix &right) const {
        const size_t columns = states_ + 1;
        Matrix out(left.size());
        for (size_t row = 0; row < states_; row++)
            for (size_t k = 0; k < states_; k++)
                for (size_t column = 0; column < columns; column++)
                    out[row * columns + column] += left[row * columns + k] * right[k * columns + column];
        return out;
    }

    void exponential(const Matrix &continuous, double h) {
        const size_t columns = states_ + 1;
        double norm = 0;
        for (size_t row = 0; row < states_; row++) {
            double total = 0;
            for (size_t k = 0; k < columns; k++) total += std::fabs(continuous[row * columns + k]);
            norm = std::max(norm, total * h);
        }
        int doublings = 0;
        for (; norm > 0.5 && doublings < 60; doublings++) norm *= 0.5;
        Matrix scaled = continuous;
        for (double &value : scaled) value *= std::ldexp(h, -doublings);
        Matrix term = scaled;
        way_ = scaled;  // less the identity until the end: no digits are lost to the 1
        for (int m = 2; m <= 16; m++) {
            term = product(term, scaled);
            for (size_t k = 0; k < term.size(); k++) way_[k] += term[k] /= m;
        }
        for (; doublings; doublings--) {
            const Matrix squared = product(way_, way_);
            for (size_t k = 0; k < way_.size(); k++) way_[k] = 2 * way_[k] + squared[k];
        }
        for (size_t row = 0; row < states_; row++) way_[row * columns + row] += 1;
    }

    void show() {
        for (const Output &one : outputs_) {
            double total = 0;
            for (size_t k = 0; k < one.row.size(); k++) total += one.row[k] * x_[k];
            if (!one.product.empty())
                total = one.factor * (x_[one.product[0]] * x_[one.product[1]] -
                                      x_[one.product[2]] * x_[one.product[3]]);
            values[one.variable] = total;
        }
    }

    size_t states_ = 0, speed_ = 0, link_ = 0;
    double scale_ = 1;  // of seconds to the time of the equations
    Matrix base_, by_speed_, way_;
    std::vector<std::pair<size_t, std::vector<Matrix>>> switches_;
    std::vector<size_t> starts_;
    std::vector<Output> outputs_;
    std::vector<double> x_, made_for_;
};

}  // namespace

std::unique_ptr<Unit> make_unit() { return std::make_unique<Plant>(); }

}  // namespace directmpc
